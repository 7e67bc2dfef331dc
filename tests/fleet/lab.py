"""Five hosts with systemd and an ssh server on one machine, as a Raspberry Pi has them. Needs root and a mount namespace of
its own (`unshare --mount`)."""

import contextlib
import pathlib
import shutil
import signal
import subprocess
import threading
import time

NAMES = ["pi0", "pi1", "pi2", "pi3", "pi4"]
CGROUPS = [pathlib.Path("/sys/fs/cgroup/systemd"), pathlib.Path("/sys/fs/cgroup/unified")]


def run(*words, check=True, **more):
    return subprocess.run(words, **{"check": check, "text": True, "capture_output": True} | more)


def wait_until(what, condition, limit_s=60.0):
    """Waits until a condition holds, and returns how long that took."""
    start = time.monotonic()
    while time.monotonic() - start < limit_s:
        if condition():
            return time.monotonic() - start
        time.sleep(0.1)
    raise AssertionError(f"not within {limit_s:.0f} s: {what}")


def show(what, start=None, **figures):
    took = "" if start is None else f" in {time.monotonic() - start:.1f} s"
    print(f"{what}{took}", *(f"{key}={value}" for key, value in figures.items()), flush=True)


class Host:
    """A host: a network namespace, a root file system of its own, and systemd as its first process."""

    interface = "eth0"

    def __init__(self, lab, number):
        self.lab, self.number, self.name = lab, number, NAMES[number]
        self.address = f"10.0.0.{10 + number}"
        self.folder = lab.folder / self.name
        self.root = self.folder / "root"
        self.process = None
        self.is_wanted = False
        # A control group in which all were killed is not used again: what starts there may be killed, too.
        self.starts = 0

    def create(self):
        self.root.mkdir(parents=True)
        self.mount_root()
        (self.root / "etc/machine-id").write_text("")
        for key in self.root.glob("etc/ssh/ssh_host_*"):
            key.unlink()
        run("ssh-keygen", "-A", "-f", str(self.root))
        self.lab.add_host(f"fleet-{self.name}", f"p{self.number}", self.address, self.interface)
        public = (self.root / "etc/ssh/ssh_host_ed25519_key.pub").read_text()
        with (self.lab.folder / "known_hosts").open("a") as known:
            known.write(f"{self.address} {public}")
        with (self.lab.folder / "ssh_config").open("a") as config:
            config.write(f"Host {self.name}\n  HostName {self.address}\n  User {self.lab.user}\n")
            config.write(f"Host {self.name}-user\n  HostName {self.address}\n  User pi\n")
        self.let_in()

    def mount_root(self):
        disk = self.folder / "disk"
        disk.mkdir()
        # As small as an old card, and quickly full.
        run("mount", "-t", "tmpfs", "-o", "size=400m", "tmpfs", str(disk))
        for folder in ["upper", "work"]:
            (disk / folder).mkdir()
        layers = f"lowerdir={self.lab.image},upperdir={disk}/upper,workdir={disk}/work"
        run("mount", "-t", "overlay", "-o", layers, "overlay", str(self.root))

    def let_in(self):
        """Names the host, and lets the operator log in."""
        (self.root / "etc/hostname").write_text(f"{self.name}\n")
        (self.root / "root/.ssh").mkdir(mode=0o700, exist_ok=True)
        shutil.copy(self.lab.folder / "key.pub", self.root / "root/.ssh/authorized_keys")
        # As on a card: a user with a password, who may become root.
        run("chroot", str(self.root), "useradd", "--create-home", "--shell", "/bin/bash", "pi")
        run("chroot", str(self.root), "chpasswd", input="pi:raspberry\n")
        (self.root / "etc/sudoers.d/pi").write_text("pi ALL=(ALL) NOPASSWD: ALL\n")
        home = self.root / "home/pi/.ssh"
        home.mkdir(mode=0o700)
        shutil.copy(self.lab.folder / "key.pub", home / "authorized_keys")
        run("chroot", str(self.root), "chown", "-R", "pi:pi", "/home/pi/.ssh")

    def options(self):
        """More options of systemd-nspawn."""
        return ""

    def cgroups(self):
        return [cgroup / f"{self.lab.folder.name}-{self.name}-{self.starts}" for cgroup in CGROUPS]

    def start(self):
        """Starts the host, and again whenever it restarts itself."""
        self.is_wanted = True
        threading.Thread(target=self._keep, daemon=True).start()

    def _keep(self):
        while self.is_wanted:
            self.starts += 1
            for cgroup in self.cgroups():
                cgroup.mkdir()
            join = "; ".join(f"echo $$ > {it}/cgroup.procs" for it in self.cgroups())
            nspawn = (
                f"systemd-nspawn --quiet --directory={self.root} --machine={self.name} --register=no --keep-unit --capability=CAP_NET_ADMIN "
                f"--network-namespace-path=/run/netns/fleet-{self.name} --boot --console=pipe {self.options()}"
            )
            with (self.folder / "console").open("a") as console:
                self.process = subprocess.Popen(
                    ["sh", "-c", f"{join}; exec {nspawn}"], stdin=subprocess.DEVNULL, stdout=console, stderr=console
                )
                self.process.wait()
            self.remove_cgroups()
            time.sleep(0.5)

    def cut_power(self, off_s=0.0):
        """Ends all processes at once; the host starts again by itself."""
        (self.cgroups()[1] / "cgroup.kill").write_text("1")
        time.sleep(off_s)

    def remove_cgroups(self):
        def are_gone():
            for cgroup in self.cgroups():
                run("find", str(cgroup), "-depth", "-type", "d", "-delete", check=False)
            return not any(cgroup.exists() for cgroup in self.cgroups())

        # Killed processes are in them for a moment.
        wait_until(f"control groups of {self.name} are gone", are_gone, 10)

    def unplug(self, is_unplugged=True):
        """Cuts the host off the network, or back on."""
        state = "down" if is_unplugged else "up"
        run("ip", "-n", "fleet-sw", "link", "set", f"p{self.number}", state)

    def ssh(self, *words, check=True, suffix=""):
        config = str(self.lab.folder / "ssh_config")
        return self.lab.on_operator("ssh", "-F", config, self.name + suffix, *words, check=check)

    def is_up(self):
        return self.ssh("systemctl", "is-system-running", check=False).stdout.strip() in ["running", "degraded"]

    def slot(self, link):
        """The slot that a link leads to, by name. `None` if it leads nowhere."""
        path = self.root / "opt/muster" / link
        if not path.is_symlink():
            return None
        name = path.readlink().name
        return name if (self.root / "opt/muster/slots" / name / "musterd").is_file() else None

    def end(self):
        self.is_wanted = False
        with contextlib.suppress(OSError):
            self.cut_power()
        if self.process:
            self.process.wait()
        self.remove_cgroups()
        for mount in [self.root, self.folder / "disk"]:
            run("umount", "--lazy", str(mount), check=False)
        run("ip", "netns", "del", f"fleet-{self.name}", check=False)


class Lab:
    """The hosts, a switch, and the operator's machine."""

    # The user that the operator logs in as.
    user = "root"

    def __init__(self, folder, image, hosts=len(NAMES), kind=Host):
        self.folder, self.image = pathlib.Path(folder), pathlib.Path(image)
        self.hosts = [kind(self, number) for number in range(hosts)]

    def __enter__(self):
        try:
            return self.start()
        except BaseException:
            self.__exit__()
            raise

    def start(self):
        pathlib.Path("/run/systemd/nspawn").mkdir(parents=True, exist_ok=True)
        for folder in ["/run/systemd/nspawn", "/run/netns"]:
            run("mount", "-t", "tmpfs", "tmpfs", folder)
        if not (self.folder / "key").exists():
            run("ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", str(self.folder / "key"))
        config = (
            f"IdentityFile {self.folder}/key\nUserKnownHostsFile {self.folder}/known_hosts\n"
            "BatchMode yes\nConnectTimeout 3\nServerAliveInterval 1\nServerAliveCountMax 5\nLogLevel ERROR\n"
        )
        (self.folder / "ssh_config").write_text(config)
        run("ip", "netns", "del", "fleet-sw", check=False)
        run("ip", "netns", "add", "fleet-sw")
        for command in ["link add br0 type bridge mcast_snooping 0", "link set br0 up"]:
            run("ip", "-n", "fleet-sw", *command.split())
        self.add_host("fleet-op", "op", "10.0.0.100")
        for host in self.hosts:
            host.create()
        for host in self.hosts:
            host.start()
        for host in self.hosts:
            wait_until(f"{host.name} is up", host.is_up)
        return self

    def add_host(self, namespace, port, address, interface="eth0"):
        run("ip", "netns", "del", namespace, check=False)
        run("ip", "netns", "add", namespace)
        for command in [
            f"ip link add {interface} netns {namespace} type veth peer name {port} netns fleet-sw",
            f"ip -n fleet-sw link set {port} master br0 up",
            f"ip -n {namespace} addr add {address}/24 brd + dev {interface}",
            f"ip -n {namespace} link set {interface} up",
            f"ip -n {namespace} link set lo up",
        ]:
            run(*command.split())
        # With a radio, the fleet's file names the interface.
        if interface == "eth0":
            run("ip", "-n", namespace, "route", "add", "224.0.0.0/4", "dev", interface)

    def on_operator(self, *words, check=True, **more):
        return run("ip", "netns", "exec", "fleet-op", *words, check=check, **more)

    def start_on_operator(self, *words):
        """Starts a process on the operator's machine, in a process group of its own."""
        return self.start_in("fleet-op", *words)

    def start_in(self, namespace, *words):
        """The same with the network of a host."""
        return subprocess.Popen(
            ["ip", "netns", "exec", namespace, *words],
            text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True,
        )

    def __exit__(self, *_):
        for host in self.hosts:
            host.end()
        for namespace in ["fleet-op", "fleet-sw"]:
            run("ip", "netns", "del", namespace, check=False)


def end(process):
    """Ends a process and all that it started, as pulling the plug would."""
    import os

    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.communicate()
