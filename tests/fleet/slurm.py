"""A campaign on three nodes of Slurm, one of which loses its power half-way, and the same over ssh without Slurm: `slurm.py MUSTER
IMAGE [RUNS]`. IMAGE is that of `lab.py` with the packages `slurm-wlm` and `munge`."""

import os
import pathlib
import sys
import tempfile
import time

from lab import Host, Lab, run, wait_until

# A node that does not answer for 10 s is down, and its tasks are queued again.
SLURM = """ClusterName=lab
SlurmctldHost=pi0
SlurmUser=slurm
AuthType=auth/munge
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
StateSaveLocation=/var/spool/slurmctld
SlurmdSpoolDir=/var/spool/slurmd
SlurmctldLogFile=/var/log/slurm/slurmctld.log
SlurmdTimeout=10
SlurmctldTimeout=10
ReturnToService=2
MinJobAge=3600
NodeName=pi[0-2] CPUs=2 State=UNKNOWN
PartitionName=all Nodes=pi[0-2] Default=YES MaxTime=INFINITE State=UP
"""
SHARDS = 12
CAMPAIGN = ["thesis-1", "--set", "radio.loss=0.1"]


class Node(Host):
    """A host that sees a folder of all nodes."""

    shared = None

    def options(self):
        return f"--bind={self.shared}"

    def let_in(self):
        super().let_in()
        # They wait for long for what `prepare` writes.
        for unit in ["munge", "slurmctld", "slurmd"]:
            (self.root / f"etc/systemd/system/multi-user.target.wants/{unit}.service").unlink()


def prepare(lab):
    key = os.urandom(1024)
    for host in lab.hosts:
        path = host.root / "etc/munge/munge.key"
        path.write_bytes(key)
        run("chroot", str(host.root), "chown", "munge:munge", "/etc/munge/munge.key")
        path.chmod(0o400)
        (host.root / "etc/slurm").mkdir(exist_ok=True)
        (host.root / "etc/slurm/slurm.conf").write_text(SLURM)
        (host.root / "etc/slurm/cgroup.conf").write_text("CgroupPlugin=disabled\n")
        with (host.root / "etc/hosts").open("a") as hosts:
            hosts.writelines(f"{it.address} {it.name}\n" for it in lab.hosts)
        for folder in ["spool/slurmctld", "spool/slurmd", "log/slurm"]:
            (host.root / "var" / folder).mkdir(exist_ok=True)
        host.ssh("chown", "slurm:", "/var/spool/slurmctld", "/var/log/slurm")
        host.ssh("hostname", host.name)
        host.ssh("systemctl", "restart", "munge")
    lab.hosts[0].ssh("systemctl", "restart", "slurmctld")
    for host in lab.hosts:
        host.ssh("systemctl", "restart", "slurmd")
    wait_until("three nodes are idle", lambda: "3 idle" in nodes(lab), 90)


def nodes(lab):
    return lab.hosts[0].ssh("sinfo", "--noheader", "--format=%D' '%t", check=False).stdout


def running(lab):
    """Names of the nodes that run tasks."""
    return lab.hosts[0].ssh("squeue", "--noheader", "--states=running", "--format=%N").stdout.split()


def files(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def by_slurm(lab, shared, words):
    run(*words, "--slurm", str(SHARDS), "--out", "many", cwd=shared)
    start = time.monotonic()
    lab.hosts[0].ssh(str(shared / "many/submit.sh"))
    parts = shared / "many/parts"
    flown = lambda: len(list(parts.glob("*/summary.html")))
    wait_until("half of the shards are flown", lambda: flown() >= SHARDS // 2, 1_200)
    # The controller's own node stays.
    busy = lambda: [it for it in lab.hosts[1:] if it.name in running(lab)]
    wait_until("a node has a task to lose", busy)
    lost = busy()[0]
    lost.is_wanted = False
    lost.cut_power()
    print(f"power of {lost.name} cut after {time.monotonic() - start:.1f} s, {flown()} of {SHARDS} shards flown", flush=True)
    whole = shared / "many/whole"
    wait_until("the shards are joined", lambda: (whole / "summary.html").exists(), 1_200)
    wait_until("no job is left", lambda: not lab.hosts[0].ssh("squeue", "--noheader").stdout.strip(), 60)
    log = (lab.hosts[0].root / "var/log/slurm/slurmctld.log").read_text()
    requeued = sum("requeue" in line.lower() for line in log.splitlines())
    assert requeued > 0, "no task was queued again"
    assert files(whole) == files(shared / "one"), "the bytes differ"
    took = time.monotonic() - start
    print(f"on three nodes of Slurm, one lost: complete and byte-identical in {took:.1f} s; lines about requeuing: {requeued}", flush=True)


def by_hosts(lab, shared, words, alone_s):
    hosts = [
        f'[[hosts]]\nrun = ["ssh", "-F", "{lab.folder}/ssh_config", "{host.name}"]\ndrones = [{host.number}]\n' for host in lab.hosts
    ]
    (shared / "hosts.toml").write_text('group = "239.78.0.1:4700"\n' + "".join(hosts))
    start = time.monotonic()
    process = lab.start_on_operator(*words, "--hosts", str(shared / "hosts.toml"), "--out", str(shared / "ssh"))
    lost = lab.hosts[2]
    wait_until("pi2 flies", lambda: lost.ssh("pgrep", "-f", "campaign", check=False).returncode == 0)
    time.sleep(alone_s / 4)
    assert process.poll() is None, "it ended before a host was lost"
    lost.cut_power()
    said = process.communicate(timeout=1_200)[1]
    assert files(shared / "ssh/whole") == files(shared / "one"), said
    print(f"on three hosts over ssh, one lost: complete and byte-identical in {time.monotonic() - start:.1f} s", flush=True)
    wait_until("pi2 is up", lost.is_up)


def main():
    muster, image, runs = os.path.realpath(sys.argv[1]), os.path.realpath(sys.argv[2]), int((sys.argv[3:] or ["1000"])[0])
    with tempfile.TemporaryDirectory(prefix="fleet-") as folder, tempfile.TemporaryDirectory(prefix="shared-") as shared:
        shared = pathlib.Path(shared)
        program = shared / "muster"
        run("cp", muster, str(program))
        words = [str(program), "campaign", *CAMPAIGN, "--seeds", f"0..{runs}"]
        start = time.monotonic()
        run(*words, "--out", "one", cwd=shared, check=False)
        alone_s = time.monotonic() - start
        print(f"{runs} runs on this machine alone: {alone_s:.1f} s", flush=True)
        Node.shared = shared
        with Lab(folder, image, hosts=3, kind=Node) as lab:
            by_hosts(lab, shared, words, alone_s)
            prepare(lab)
            by_slurm(lab, shared, words)


main()
