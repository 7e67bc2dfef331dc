"""Rollouts to five hosts with systemd and sshd: `rollouts.py MUSTER MUSTERD IMAGE [--short]`."""

import filecmp
import json
import os
import pathlib
import shutil
import sys
import tempfile
import time

from interruptions import interrupted, operator_cut_off, power_cut_on_trial
from lab import Lab, end, run, show, wait_until

WITHIN_S, HOLD_S = 20, 8
# From the failure of a gate until the host is healthy with the release before.
BACK_MAX_S = 30.0

FLEET = """group = "239.78.0.1:4700"
transport = "{transport}"
scenario = "{scenario}"
keys = "keys"
flight = {flight}

[gate]
within_s = {within_s}
hold_s = {hold_s}

{hosts}

[[waves]]
hosts = ["pi0"]
soak_s = {soak_s}

[[waves]]
hosts = ["pi1", "pi2"]
soak_s = {soak_s}

[[waves]]
hosts = ["pi3", "pi4"]
at_once = {at_once}
soak_s = {soak_s}
"""

HOST = """[[hosts]]
name = "{name}"
run = ["ssh", "-F", "{config}", "{name}{suffix}"]
drones = [{number}]
{controller}"""

# What a broken release's musterd does when a service starts it. The rest is a good musterd's.
BROKEN = {
    "crashes-at-start": "exit 1",
    "never-proves-itself": 'sed "s/239.78.0.1:4700/239.78.0.99:4799/" /opt/muster/current/config/drone-*.toml '
    '> /var/lib/muster/own.toml; cp /opt/muster/current/config/* /var/lib/muster/; '
    'set -- --config /var/lib/muster/own.toml',
    "fills-the-disk": "cat /dev/zero > /var/lib/muster/full; sleep 1",
    "hangs-after-5-s": "(sleep 5; kill -STOP $$) &",
    "dies-after-5-s": "(sleep 5; kill -KILL $$) &",
    "hears-no-controller": 'sed "s/tcp:127.0.0.1:5761/tcp:127.0.0.1:5799/" /opt/muster/current/config/drone-*.toml '
    '> /var/lib/muster/own.toml; cp /opt/muster/current/config/* /var/lib/muster/; '
    'set -- --config /var/lib/muster/own.toml',
    "hangs-in-the-soak": "(sleep 14; kill -STOP $$) &",
}


class Bench:
    def __init__(self, lab, muster, musterd):
        self.lab, self.muster, self.musterd = lab, muster, musterd
        self.folder = lab.folder
        self.releases = {}
        # What `apply` has printed.
        self.said = []
        run(muster, "keys", "fleet", str(self.folder / "keys"))
        run(muster, "keys", "drone", str(self.folder / "keys"), *"01234")
        self.write_fleet()
        self.package("0.1.1")

    @property
    def hosts(self):
        return self.lab.hosts

    def write_fleet(self, suffix="", controller=None, **fields):
        """`controller`: lines of the first host about its flight controller. `fields` of the file replace the usual ones."""
        usual = {
            "flight": 1, "soak_s": 1, "scenario": "swarm-short", "transport": "udp",
            "within_s": WITHIN_S, "hold_s": HOLD_S, "at_once": 1,
        }
        config = self.folder / "ssh_config"
        lines = lambda host: f"{controller}\n" if controller and host.number == 0 else ""
        hosts = "\n".join(
            HOST.format(name=it.name, number=it.number, config=config, suffix=suffix, controller=lines(it)) for it in self.hosts
        )
        (self.folder / "fleet.toml").write_text(FLEET.format(hosts=hosts, **usual | fields))

    def package(self, version, broken=None):
        """A release; a broken one behaves until a service starts it."""
        programs = self.folder / f"programs-{version}" / "x86_64"
        programs.mkdir(parents=True)
        (programs / "muster").write_text("#!/bin/sh\n")
        if broken is None:
            shutil.copy(self.musterd, programs / "musterd")
        else:
            script = f'#!/bin/sh\ncase "$1" in --config) {BROKEN[broken]};; esac\nexec /opt/good-musterd "$@"\n'
            (programs / "musterd").write_text(script)
        run(
            self.muster, "deploy", "package", "--programs", str(programs.parent), "--keys", str(self.folder / "keys"),
            "--release-version", version, "--out", str(self.folder),
        )
        shutil.rmtree(programs.parent)
        self.releases[version] = str(self.folder / f"muster-{version}.tar.gz")

    def words(self, command, version=None, *more):
        words = [self.muster, "deploy", command, str(self.folder / "fleet.toml"), *more]
        return words + (["--release", self.releases[version]] if version else [])

    def apply(self, version, *more):
        """Applies a release. Returns the exit code, and the report."""
        done = self.lab.on_operator(*self.words("apply", version, "--json", *more), check=False)
        self.said += [done.stdout, done.stderr]
        try:
            return done.returncode, json.loads(done.stdout), done.stderr
        except json.JSONDecodeError:
            raise AssertionError(f"no report: {done.returncode} {done.stdout} {done.stderr}") from None

    def status(self):
        done = self.lab.on_operator(*self.words("status"), "--json", check=False)
        hosts = json.loads(done.stdout)["hosts"]
        for host in hosts:
            if not host.get("facts"):
                show(f"no status of {host['name']}", why=host.get("error"))
        return {it["name"]: it.get("facts") for it in hosts}

    def is_well(self, host):
        facts = self.status()[host.name]
        healths = [it["health"] for it in facts["drones"].values()] if facts else []
        return bool(healths) and all("Healthy" in it for it in healths) and not facts["is_on_trial"]

    def assert_all_run(self, version):
        status = self.status()
        for name, facts in status.items():
            assert facts and facts["current"]["version"] == version, (name, facts)
            assert not facts["is_on_trial"] and facts["good"].startswith(version), facts
            for drone in facts["drones"].values():
                assert "Healthy" in drone["health"], (name, facts)

    def assert_can_roll_back(self):
        """No host is without a working slot, whatever it is doing."""
        for host in self.hosts:
            good = host.slot("good")
            assert good, f"{host.name} has no working slot"
            self.assert_whole(host.root / "opt/muster/slots" / good)

    def assert_no_half_slots(self):
        """All hosts run what they go back to, and no file is half-written."""
        for host in self.hosts:
            current = host.slot("current")
            assert current and current == host.slot("good"), (host.name, current, host.slot("good"))
            for slot in (host.root / "opt/muster/slots").iterdir():
                if not slot.name.startswith("."):
                    self.assert_whole(slot)

    def assert_whole(self, slot):
        json.loads((slot / "slot.json").read_text())
        program = slot / "musterd"
        is_script = program.read_bytes().startswith(b"#!/bin/sh")
        assert is_script or filecmp.cmp(program, self.musterd, shallow=False), program


def outcomes(report):
    return [it["outcome"] for it in report["hosts"]]


def first_rollout(bench):
    planned = json.loads(bench.lab.on_operator(*bench.words("plan", "0.1.1"), "--json").stdout)
    assert {it["work"]["kind"] for it in planned["hosts"]} == {"install"}, planned
    start = time.monotonic()
    code, report, errors = bench.apply("0.1.1")
    assert code == 0 and set(outcomes(report)) == {"changed"}, (report, errors)
    bench.assert_all_run("0.1.1")
    proven = [len(it["drones"][str(n)]["health"]["Healthy"]["proven"]) for n, it in enumerate(bench.status().values())]
    assert proven[4] == 4, proven
    show("first rollout to five hosts", start)


def unchanged(bench):
    start = time.monotonic()
    code, report, errors = bench.apply("0.1.1")
    assert code == 0 and set(outcomes(report)) == {"unchanged"}, (report, errors)
    show("apply of an unchanged release", start)
    start = time.monotonic()
    bench.status()
    show("status", start)


def upgrade(bench):
    bench.package("0.1.2")
    start = time.monotonic()
    code, report, errors = bench.apply("0.1.2")
    assert code == 0 and set(outcomes(report)) == {"changed"}, (report, errors)
    bench.assert_all_run("0.1.2")
    show("upgrade of five hosts", start)


def rollback(bench):
    start = time.monotonic()
    rolled = json.loads(bench.lab.on_operator(*bench.words("rollback"), "--json").stdout)
    assert all(it["slot"].startswith("0.1.1") for it in rolled["hosts"]), rolled
    bench.assert_all_run("0.1.1")
    show("rollback of five hosts", start)
    code, report, errors = bench.apply("0.1.2")
    assert code == 0, (report, errors)


def broken_releases(bench, kinds):
    for kind in kinds:
        version = f"0.2.{list(BROKEN).index(kind)}"
        bench.package(version, kind)
        start = time.monotonic()
        code, report, errors = bench.apply(version)
        took, ended = time.monotonic() - start, time.time()
        assert code == 1 and report["stopped"], (kind, report, errors)
        assert outcomes(report) == ["went_back"] + ["not_reached"] * 4, (kind, report, errors)
        # The host notes why it goes back, and the report comes once it is healthy again.
        back_s = ended - (bench.hosts[0].root / "opt/muster/last-failure.json").stat().st_mtime
        assert 0 < back_s <= BACK_MAX_S, (kind, errors)
        assert bench.is_well(bench.hosts[0]), kind
        bench.assert_all_run("0.1.2")
        bench.assert_no_half_slots()
        show(f"{kind}: stopped at the canary", took=f"{took:.1f}s", back=f"{back_s:.1f}s", why=report["stopped"])
        (bench.hosts[0].root / "var/lib/muster/full").unlink(missing_ok=True)


def dead_controller(bench):
    """A release that does not reach the flight controller is stopped at the canary, which has one."""
    simulated = bench.lab.start_in(f"fleet-{bench.hosts[0].name}", bench.muster, "fc", "simulate", "--listen", "127.0.0.1:5761")
    try:
        bench.write_fleet(controller='controller = "tcp:127.0.0.1:5761"\nreceiver = "sole"')
        code, report, errors = bench.apply("0.1.2")
        assert code == 0, (report, errors)
        broken_releases(bench, ["hears-no-controller"])
        bench.write_fleet()
        code, report, errors = bench.apply("0.1.2")
        assert code == 0, (report, errors)
    finally:
        end(simulated)


def ill_while_it_soaks(bench):
    """A release that proves itself to its host and gets ill later: the wave is taken back by the operator's machine."""
    bench.package("0.2.9", "hangs-in-the-soak")
    bench.write_fleet(soak_s=20)
    code, report, errors = bench.apply("0.2.9")
    assert code == 1 and outcomes(report) == ["taken_back"] + ["not_reached"] * 4, (report, errors)
    bench.assert_all_run("0.1.2")
    took_s = report["hosts"][0]["took_s"]
    assert took_s <= BACK_MAX_S, took_s
    show("hangs in the soak: the wave is taken back", back=f"{took_s:.1f}s", why=report["stopped"])
    bench.write_fleet()


def broken_signature(bench):
    path = pathlib.Path(bench.releases["0.1.1"])
    altered = bytearray(path.read_bytes())
    altered[len(altered) // 2] ^= 1
    bench.releases["altered"] = str(bench.folder / "altered.tar.gz")
    pathlib.Path(bench.releases["altered"]).write_bytes(altered)
    done = bench.lab.on_operator(*bench.words("apply", "altered"), check=False)
    assert done.returncode == 2, done
    bench.assert_all_run("0.1.2")
    show("altered archive: refused", code=done.returncode)


def second_operator(bench):
    bench.package("0.4.0")
    first = bench.lab.start_on_operator(*bench.words("apply", "0.4.0"))
    wait_until("the switch", lambda: (bench.hosts[0].slot("current") or "").startswith("0.4.0"))
    code, report, errors = bench.apply("0.1.1")
    first.communicate()
    assert first.returncode == 0, errors
    blocked = [it["remark"] or "" for it in report["hosts"]]
    # Either it is refused by name, or it waited for the first to end; never both at once.
    assert code == 1 and any("locked by" in it for it in blocked) or set(outcomes(report)) == {"changed"}, report
    code, report, errors = bench.apply("0.1.2")
    assert code == 0, (report, errors)
    bench.assert_all_run("0.1.2")
    show("second operator: locked out", code=code)


def in_flight(bench):
    """Numbers of the drones in flight."""
    drones = [it["drones"].items() for it in bench.status().values() if it]
    return {int(number) for of_host in drones for number, drone in of_host if drone["in_flight"]}


def start_flight(bench, master, flight):
    """The swarm takes off; the drone of one host leads."""
    unit = f"musterd@{master.number}"
    # The service as it is, but for --fly.
    program = "/opt/muster/current/musterd --config /opt/muster/current/config/drone-%i.toml --fly"
    master.ssh("systemctl", "kill", "--signal=KILL", unit)
    master.ssh("systemctl", "stop", unit)
    master.ssh("rm", "-rf", f"/var/lib/muster/journal-{master.number}/flight-{flight}")
    extra = f"/run/systemd/system/{unit}.service.d"
    lines = f"[Service]\\nExecStart=\\nExecStart={program}\\n".replace("%", "%%")
    master.ssh(f"mkdir -p {extra} && printf '{lines}' > {extra}/fly.conf && systemctl daemon-reload && systemctl start {unit}")
    # Its next start is an ordinary one.
    master.ssh(f"rm -r {extra} && systemctl daemon-reload")
    wait_until("the swarm flies", lambda: in_flight(bench) == set(range(5)), 30)


def recall(bench):
    """Drones of a flying swarm are called down, a host at a time, the master last; the others elect and fly on."""
    text = (
        'seed = 1\n[formation]\nkind = "linear"\ndrones = 5\nspacing_m = 20\n[mission]\nfile = "hop"\n[radio]\nrange_m = 300\n'
        '[protocol]\npolicy = "tree"\nparameters = "fast"\n[vehicle]\nspeed_mps = 0.4\n[safety]\navoid = true\n'
    )
    (bench.folder / "long.toml").write_text(text)
    bench.write_fleet(flight=4, scenario="long.toml")
    code, report, errors = bench.apply("0.1.2")
    assert code == 0, (report, errors)
    start_flight(bench, bench.hosts[2], flight=4)
    start, fewest = time.monotonic(), 5
    apply = bench.lab.start_on_operator(*bench.words("apply", "0.1.1", "--json", "--recall", "--keep-flying", "2"))
    while apply.poll() is None:
        fewest = min(fewest, len(in_flight(bench)))
        time.sleep(0.2)
    report = json.loads(apply.communicate()[0])
    assert fewest >= 2, fewest
    assert in_flight(bench) == {3, 4}, in_flight(bench)
    assert outcomes(report) == ["changed"] * 3 + ["deferred"] * 2, report
    log = bench.hosts[4].ssh("journalctl", "--no-pager", "--unit=musterd@4").stdout
    ballots = {line.split("follows ballot ")[1] for line in log.splitlines() if "follows ballot" in line}
    assert len(ballots) >= 2, ballots
    show("recall of three of five drones, one at a time, the master last", start, fewest=fewest, ballots=len(ballots))
    wait_until("the others have landed", lambda: in_flight(bench) == set(), 400)
    bench.write_fleet(flight=5)
    code, report, errors = bench.apply("0.1.2")
    assert code == 0, (report, errors)
    bench.assert_all_run("0.1.2")


def flying(bench):
    """An upgrade that is asked for while the swarm flies is deferred, and done after the landing."""
    bench.write_fleet(flight=2)
    code, report, errors = bench.apply("0.1.2")
    assert code == 0, (report, errors)
    start_flight(bench, bench.hosts[2], flight=2)
    code, report, errors = bench.apply("0.1.1")
    assert code == 1 and set(outcomes(report)) == {"deferred"}, (report, errors)
    wait_until("all have landed", lambda: in_flight(bench) == set(), 120)
    bench.write_fleet(flight=3)
    start = time.monotonic()
    code, report, errors = bench.apply("0.1.1")
    assert code == 0 and set(outcomes(report)) == {"changed"}, (report, errors)
    bench.assert_all_run("0.1.1")
    show("upgrade asked for in flight: deferred, then done after the landing", start)
    code, report, errors = bench.apply("0.1.2")
    assert code == 0, (report, errors)


def secrets(bench):
    """No secret is in an archive, a log, or a file that others can read."""
    digits = [it.read_text().split()[-1] for it in (bench.folder / "keys").glob("*.key")]
    assert len(digits) == 6
    reports = [bench.lab.on_operator(*bench.words(it), "--json", check=False).stdout for it in ["status", "audit"]]
    processes = run("ps", "axeww").stdout
    assert "musterd --config" in processes
    for text in [processes, *reports, *bench.said]:
        assert not any(it in text for it in digits), text
    for host in bench.hosts:
        log = host.ssh("journalctl", "--no-pager").stdout
        assert not any(it in log for it in digits), host.name
        for slot in (host.root / "opt/muster/slots").iterdir():
            for path in slot.rglob("*"):
                if path.is_file() and any(it.encode() in path.read_bytes() for it in digits):
                    assert path.stat().st_mode & 0o077 == 0, path
    for archive in bench.folder.glob("*.tar.gz"):
        packed = run("zcat", str(archive), text=False).stdout if archive.name != "altered.tar.gz" else b""
        assert not any(it.encode() in packed or bytes.fromhex(it) in packed for it in digits), archive
    show("no secret in archives, logs, process lists, reports, or files of others", reports=len(bench.said))


def audit(bench):
    """A stock host has findings; `--fix` leaves none, and locks nobody out."""
    bench.write_fleet(suffix="-user")
    words = [bench.muster, "deploy", "audit", str(bench.folder / "fleet.toml"), "--json", "--updates"]
    # Debian's package switches updates on; a card's maker may have them off.
    for host in bench.hosts:
        (host.root / "etc/apt/apt.conf.d/20auto-upgrades").write_text('APT::Periodic::Unattended-Upgrade "0";\n')

    def findings(*more):
        done = bench.lab.on_operator(*words, *more, check=False)
        hosts = json.loads(done.stdout)["hosts"]
        return {it["name"]: it.get("error") or {found["rule"] for found in it["findings"]} for it in hosts}

    before = findings()
    stock = {"ssh-keys-only", "ssh-no-root", "ssh-banner", "ssh-log", "no-passwords", "firewall", "security-updates"}
    assert all(it == stock for it in before.values()), before
    # One host is off the network as soon as its settings are changed.
    lost = bench.hosts[4]
    settings = lambda host: host.root / "etc/ssh/sshd_config.d/00-muster.conf"
    fixing = bench.lab.start_on_operator(*words, "--fix")
    wait_until("settings of the lost host", lambda: settings(lost).exists())
    lost.unplug()
    output, _ = fixing.communicate(timeout=180)
    after = {it["name"]: it.get("findings", it.get("error")) for it in json.loads(output)["hosts"]}
    assert all(after[host.name] == [] for host in bench.hosts[:4]), after
    assert after[lost.name], after
    took = wait_until("the lost host's settings are undone", lambda: not settings(lost).exists(), 90)
    lost.unplug(False)
    wait_until("its firewall is gone", lambda: "muster" not in lost.ssh("nft", "list", "tables", check=False).stdout, 30)
    show("settings of a host that was cut off are undone", after=f"{took:.0f}s")
    times = [settings(host).stat().st_mtime for host in bench.hosts[:4]]
    assert all(it == set() for it in findings("--fix").values())
    assert times == [settings(host).stat().st_mtime for host in bench.hosts[:4]], "a second --fix changes nothing"
    for host in bench.hosts:
        assert host.ssh("true", check=False).returncode == 255, "root is not let in"
        assert host.ssh("true", suffix="-user").returncode == 0
        host.ssh("sudo", "systemctl", "kill", "--signal=KILL", f"musterd@{host.number}", suffix="-user")
    hears = lambda it: it and len(next(iter(it["drones"].values()))["health"].get("Healthy", {}).get("proven", []))
    wait_until("drones hear each other through the firewall", lambda: all(hears(it) == 4 for it in bench.status().values()))
    serial_port_and_quic(bench)
    unit = bench.hosts[0].ssh("sudo", "systemd-analyze", "security", "--no-pager", "musterd@0", suffix="-user")
    exposure = unit.stdout.rsplit(":", 1)[-1].split()[0]
    assert float(exposure) <= 2.0, exposure
    show("audit: from findings to none, ssh works, drones hear each other", findings=len(stock), exposure=exposure)


def serial_port_and_quic(bench):
    """In its sandbox and behind the firewall, a drone reaches its serial port and its peers by QUIC."""
    host = bench.hosts[0]
    shutil.copy(bench.muster, host.root / "opt/controller")
    command = "/opt/controller fc simulate --pty /dev/ttyACM0"
    host.ssh("sudo", "systemd-run", "--quiet", "--unit=controller", *command.split(), suffix="-user")
    wait_until("the serial port is there", lambda: host.ssh("test", "-e", "/dev/ttyACM0", check=False, suffix="-user").returncode == 0)
    # As udev does it for a real one.
    host.ssh("sudo", "sh", "-c", "'chgrp dialout /dev/ttyACM0 && chmod 660 /dev/ttyACM0'", suffix="-user")
    # Motors may hang on a serial port: nothing arms them.
    port = 'controller = "serial:/dev/ttyACM0"\nreceiver = "sole"\nstage = "bench"'
    bench.write_fleet(suffix="-user", flight=9, transport="quic", controller=port)
    planned = json.loads(bench.lab.on_operator(*bench.words("plan", "0.1.2"), "--json").stdout)
    assert all("this can't come in waves" in it["work"].get("why", "") for it in planned["hosts"]), planned
    code, report, errors = bench.apply("0.1.2")
    assert code == 1 and set(outcomes(report)) == {"failed"}, (report, errors)
    show("another transport: refused while drones run", why=report["hosts"][0]["remark"])
    for it in bench.hosts:
        it.ssh("sudo", "systemctl", "stop", f"musterd@{it.number}", suffix="-user")
    code, report, errors = bench.apply("0.1.2")
    assert code == 0, (report, errors)
    bench.assert_all_run("0.1.2")
    peers = [len(next(iter(it["drones"].values()))["health"]["Healthy"]["proven"]) for it in bench.status().values()]
    assert peers == [4] * 5, peers


def main():
    muster, musterd, image = (os.path.realpath(it) for it in sys.argv[1:4])
    is_short = "--short" in sys.argv
    kills, cuts = (2, 1) if is_short else (5, 2)
    for argument in sys.argv:
        if argument.startswith("--interruptions="):
            kills, cuts = (int(it) for it in argument.split("=")[1].split("+"))
    only = [it.split("=")[1] for it in sys.argv if it.startswith("--only=")]
    seed = int(os.environ.get("MUSTER_SEED", "1"))
    with tempfile.TemporaryDirectory(prefix="fleet-") as folder, Lab(folder, image) as lab:
        shown = pathlib.Path(os.environ["KEEP_LOGS"]) if "KEEP_LOGS" in os.environ else None
        try:
            bench = Bench(lab, muster, musterd)
            for host in bench.hosts:
                shutil.copy(musterd, host.root / "opt/good-musterd")
            first_rollout(bench)
            unchanged(bench)
            upgrade(bench)
            steps = {
                "rollback": lambda: rollback(bench),
                "broken": lambda: broken_releases(bench, ["crashes-at-start"] if is_short else list(BROKEN)[:-2]),
                "controller": lambda: dead_controller(bench),
                "soak": lambda: ill_while_it_soaks(bench),
                "signature": lambda: broken_signature(bench),
                "cut-off": lambda: operator_cut_off(bench, BACK_MAX_S),
                "trial": lambda: power_cut_on_trial(bench),
                "second": lambda: second_operator(bench),
                "flying": lambda: flying(bench),
                "recall": lambda: recall(bench),
                "interrupted": lambda: interrupted(bench, kills, cuts, seed),
                "secrets": lambda: secrets(bench),
                "audit": lambda: audit(bench),
            }
            for name, step in steps.items():
                if not only or name in only:
                    step()
        finally:
            if shown:
                for host in lab.hosts:
                    log = host.ssh("journalctl", "--no-pager", check=False)
                    (shown / f"{host.name}.log").write_text(log.stdout)


main()
