"""A campaign on three Slurm nodes, one of which is killed half-way: `slurm.py MUSTER IMAGE [RUNS]`."""

import os
import pathlib
import sys
import tempfile
import time

from lab import Lab, run, wait_until

# A node that does not answer for this time is down, and its tasks are queued again.
SLURM = """ClusterName=lab
SlurmctldHost=pi0
SlurmUser=root
AuthType=auth/munge
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
StateSaveLocation=/var/spool/slurmctld
SlurmdSpoolDir=/var/spool/slurmd
SlurmdTimeout=10
SlurmctldTimeout=10
ReturnToService=2
MinJobAge=3600
NodeName=pi[0-2] CPUs=2 State=UNKNOWN
PartitionName=all Nodes=pi[0-2] Default=YES MaxTime=INFINITE State=UP
"""
SHARDS = 12
CAMPAIGN = ["thesis-1", "--set", "radio.loss=0.1"]


def prepare(lab):
    key = os.urandom(1024)
    for host in lab.hosts:
        path = host.root / "etc/munge/munge.key"
        path.write_bytes(key)
        run("chroot", str(host.root), "chown", "munge:munge", "/etc/munge/munge.key")
        path.chmod(0o400)
        (host.root / "etc/slurm").mkdir(exist_ok=True)
        (host.root / "etc/slurm/slurm.conf").write_text(SLURM)
        with (host.root / "etc/hosts").open("a") as hosts:
            hosts.writelines(f"10.78.0.{it.number + 1} {it.name}\n" for it in lab.hosts)
        for daemon in ["slurmctld", "slurmd"]:
            (host.root / f"var/spool/{daemon}").mkdir(exist_ok=True)
        host.ssh("systemctl", "restart", "munge")
    lab.hosts[0].ssh("systemctl", "restart", "slurmctld")
    for host in lab.hosts:
        host.ssh("systemctl", "restart", "slurmd")
    wait_until("three nodes are idle", lambda: "3 idle" in nodes(lab), 90)


def nodes(lab):
    return lab.hosts[0].ssh("sinfo", "--noheader", "--format=%D' '%t", check=False).stdout


def files(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def main():
    muster, image, runs = os.path.realpath(sys.argv[1]), os.path.realpath(sys.argv[2]), int((sys.argv[3:] or ["1000"])[0])
    with tempfile.TemporaryDirectory(prefix="fleet-") as folder, tempfile.TemporaryDirectory(prefix="shared-") as shared:
        shared = pathlib.Path(shared)
        program = shared / "muster"
        run("cp", muster, str(program))
        words = [str(program), "campaign", *CAMPAIGN, "--seeds", f"0..{runs}"]
        start = time.monotonic()
        run(*words, "--out", "one", cwd=shared, check=False)
        print(f"{runs} runs on this machine alone: {time.monotonic() - start:.1f} s", flush=True)
        with Lab(folder, image, hosts=3, shared=shared) as lab:
            prepare(lab)
            run(*words, "--slurm", str(SHARDS), "--out", "many", cwd=shared)
            start = time.monotonic()
            lab.hosts[0].ssh(str(shared / "many/submit.sh"))
            parts = shared / "many/parts"
            wait_until("half of the shards have begun", lambda: len(list(parts.iterdir())) >= SHARDS // 2, 600)
            lost = lab.hosts[2]
            lost.is_wanted = False
            lost.cut_power()
            print(f"pi2's power cut after {time.monotonic() - start:.1f} s", flush=True)
            whole = shared / "many/whole"
            wait_until("the shards are joined", lambda: (whole / "summary.html").exists(), 1_200)
            wait_until("no job is left", lambda: not lab.hosts[0].ssh("squeue", "--noheader").stdout.strip(), 60)
            took = time.monotonic() - start
            requeued = lab.hosts[0].ssh("grep", "-ci", "requeue", "/var/log/slurm/slurmctld.log", check=False).stdout.strip()
            assert files(whole) == files(shared / "one"), "the bytes differ"
            print(f"{runs} runs on three nodes, one killed: complete and byte-identical in {took:.1f} s; requeue lines: {requeued}")


main()
