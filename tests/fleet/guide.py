"""From card images to a fleet, by the guide's own commands: `guide.py MUSTER MUSTERD IMAGE`.

The commands are read from the guide, so what a new user would enter is what is run. Stand-ins: files for cards, a Debian for
Raspberry Pi OS, ext4 for FAT, a network of cables for the radio, and programs of this build for `deploy/cross`.
"""

import json
import os
import pathlib
import re
import shutil
import struct
import subprocess
import sys
import tempfile
import time

from lab import NAMES, Host, Lab, run, wait_until

PROJECT = pathlib.Path(__file__).resolve().parents[2]
GUIDE = PROJECT / "docs/src/guides/deploy.md"
COMMANDS_MAX = 15
SECTOR = 512
BOOT = range(2_048, 2_048 + 32_768)
ROOT = range(BOOT.stop, BOOT.stop + 1_600_000)
# A radio as the guide's commands set it; none is here.
IW = """#!/bin/sh
case "$*" in
    "dev wlan0 info") printf 'Interface wlan0\\n\\tssid muster\\n\\ttype IBSS\\n\\tchannel 6 (2437 MHz)\\n' ;;
    "dev wlan0 get power_save") echo "Power save: off" ;;
    "reg get") echo "country DE: DFS-ETSI" ;;
esac
"""
# In a container nothing sets the clock.
TIME = "[Service]\nExecStart=/bin/sleep infinity\n[Install]\nWantedBy=multi-user.target\n"
# The kernel is this machine's; its arguments are the card's.
KERNEL = (
    "[Service]\nType=oneshot\nRemainAfterExit=yes\nExecStart=/bin/mount --bind /boot/firmware/cmdline.txt /proc/cmdline\n"
    "[Install]\nWantedBy=multi-user.target\n"
)


def partitioned(image, folder):
    """A stock card: a table of two partitions, and a Debian with what `muster deploy image` finds on a Raspberry Pi OS."""
    entry = lambda part, kind: struct.pack("<B3sB3sII", 0, b"\0" * 3, kind, b"\0" * 3, part.start, len(part))
    table = entry(BOOT, 0x83) + entry(ROOT, 0x83) + b"\0" * 32 + b"\x55\xaa"
    with image.open("wb") as file:
        file.truncate(ROOT.stop * SECTOR)
        file.seek(446)
        file.write(table)
    for part, content in [(BOOT, folder / "boot"), (ROOT, folder / "root")]:
        offset, size_k = part.start * SECTOR, len(part) * SECTOR // 1024
        run("mkfs.ext4", "-q", "-F", "-O", "^has_journal", "-d", str(content), "-E", f"offset={offset}", str(image), f"{size_k}k")


def stock(debian, folder):
    root, boot = folder / "root", folder / "boot"
    boot.mkdir()
    run("cp", "-a", debian, str(root))
    (boot / "cmdline.txt").write_text("console=serial0,115200 console=tty1 root=PARTUUID=1-02 rootfstype=ext4 rootwait\n")
    (boot / "config.txt").write_text("dtparam=audio=on\n[all]\n")
    run("chroot", str(root), "useradd", "--create-home", "--shell", "/bin/bash", "pi")
    run("chroot", str(root), "chpasswd", input="pi:raspberry\n")
    (root / "etc/sudoers.d/010_pi-nopasswd").write_text("pi ALL=(ALL) NOPASSWD: ALL\n")
    (root / "usr/sbin/iw").write_text(IW)
    (root / "usr/sbin/iw").chmod(0o755)
    (root / "etc/systemd/system/systemd-timesyncd.service").write_text(TIME)
    (root / "etc/systemd/system/card-kernel.service").write_text(KERNEL)
    run("chroot", str(root), "systemctl", "enable", "systemd-timesyncd.service", "card-kernel.service")
    (root / "boot/firmware").mkdir()


class Pi(Host):
    """A host that starts from a card."""

    interface = "wlan0"

    def mount_root(self):
        card = self.lab.folder / f"card-{self.number}"
        self.boot().mkdir()
        for part, folder in [(ROOT, self.root), (BOOT, self.boot())]:
            options = f"loop,offset={part.start * SECTOR},sizelimit={len(part) * SECTOR}"
            run("mount", "-o", options, str(card), str(folder))

    def boot(self):
        return self.folder / "boot"

    def options(self):
        return f"--bind={self.boot()}:/boot/firmware"

    def end(self):
        super().end()
        run("umount", "--lazy", str(self.boot()), check=False)

    def let_in(self):
        """As the card has it."""


class Pis(Lab):
    user = "fly"


def commands():
    """The first block of commands of the guide, a line each."""
    block = re.search(r"```text\n(.*?)```", GUIDE.read_text(), re.DOTALL).group(1)
    return block.replace("\\\n", " ").strip().splitlines()


def shell(command, folder, *before):
    """Runs a command as a user does who is in the project's folder."""
    path = f"{folder}/bin:{folder}/target/programs/x86_64:{os.environ['PATH']}"
    return subprocess.run([*before, "bash", "-euc", command], cwd=folder, text=True, capture_output=True, env={**os.environ, "PATH": path})


def card_commands(lab, folder, wanted):
    for number, command in enumerate(wanted):
        (folder / f"card-{number}").touch()
        stand_ins = {"~/.ssh/id_ed25519.pub": f"{folder}/key.pub", "/dev/sda": f"{folder}/card-{number}", "img.xz": "img"}
        for name, stand_in in stand_ins.items():
            command = command.replace(name, stand_in)
        done = shell(command, folder)
        assert done.returncode == 0, (command, done.stdout, done.stderr)


def prepare(folder, muster, musterd, debian):
    programs = folder / "target/programs/x86_64"
    programs.mkdir(parents=True)
    shutil.copy(muster, programs / "muster")
    shutil.copy(musterd, programs / "musterd")
    # What the user's own configuration says to ssh.
    (folder / "bin").mkdir()
    (folder / "bin/ssh").write_text(f'#!/bin/sh\nexec /usr/bin/ssh -F {folder}/ssh_config "$@"\n')
    (folder / "bin/ssh").chmod(0o755)
    (folder / "deploy").mkdir()
    shutil.copy(PROJECT / "deploy/card", folder / "deploy/card")
    run("ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", str(folder / "key"))
    toml = re.search(r"```toml hosts\n(.*?)```", GUIDE.read_text(), re.DOTALL).group(1)
    # A second of soaking instead of a minute.
    (folder / "fleet.toml").write_text(re.sub(r"soak_s = \d+", "soak_s = 1", toml))
    with tempfile.TemporaryDirectory(prefix="fleet-stock-") as files:
        files = pathlib.Path(files)
        stock(debian, files)
        partitioned(folder / "raspios.img", files)


def main():
    muster, musterd, debian = (os.path.realpath(it) for it in sys.argv[1:4])
    wanted = commands()
    assert len(wanted) <= COMMANDS_MAX, len(wanted)
    with tempfile.TemporaryDirectory(prefix="fleet-") as folder:
        folder = pathlib.Path(folder)
        prepare(folder, muster, musterd, debian)
        lab = Pis(folder, debian, kind=Pi)
        is_card = lambda command: command.startswith("deploy/card")
        start = time.monotonic()
        card_commands(lab, folder, [it for it in wanted if is_card(it)])
        print(f"five cards in {time.monotonic() - start:.1f} s", flush=True)
        with lab:
            (folder / "known_hosts").write_text("")
            for command in wanted:
                # Stand-ins: programs are built, and the network is there.
                if is_card(command) or command.split()[0] in ["deploy/cross", "export", "nmcli"]:
                    continue
                command = command.replace("~/.ssh/known_hosts", str(folder / "known_hosts"))
                done = shell(command, folder, "ip", "netns", "exec", "fleet-op")
                assert done.returncode == 0, (command, done.stdout, done.stderr)
                print(f"$ {command}\n{done.stdout}", flush=True)
            status = json.loads(shell("muster deploy status fleet.toml --json", folder, "ip", "netns", "exec", "fleet-op").stdout)
            for host in status["hosts"]:
                (drone,) = host["facts"]["drones"].values()
                assert len(drone["health"]["Healthy"]["proven"]) == len(NAMES) - 1, host
            for host in lab.hosts:
                users = (host.root / "etc/passwd").read_text()
                assert "pi:x" not in users and "fly:x" in users, users
                assert "regdom=DE" in host.ssh("cat", "/proc/cmdline").stdout
    print(f"{len(wanted)} commands of the guide, from card images to five drones that have proven themselves to each other")


main()
