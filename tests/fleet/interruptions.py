"""What an interrupted rollout leaves: the operator's machine is gone, `apply` is killed, a host loses its power."""

import random
import statistics
import time

from lab import end, run, show, wait_until


def operator_cut_off(bench, back_max_s):
    """The operator's machine is gone right after the switch to a release that fails."""
    host = bench.hosts[0]
    good = host.slot("good")
    version = "0.3.0"
    bench.package(version, "dies-after-5-s")
    apply = bench.lab.start_on_operator(*bench.words("apply", version))
    wait_until("the switch", lambda: (host.slot("current") or "").startswith(version))
    run("ip", "-n", "fleet-sw", "link", "set", "op", "down")
    end(apply)
    took = wait_until("the host went back by itself", lambda: host.slot("current") == good, back_max_s)
    run("ip", "-n", "fleet-sw", "link", "set", "op", "up")
    wait_until("it is healthy", lambda: bench.is_well(host), back_max_s)
    failure = bench.status()[host.name]["failure"]
    show("operator cut off after the switch: the host went back", back=f"{took:.1f}s", why=failure["why"])


def power_cut_on_trial(bench):
    """A host restarts before its release has proven itself: it goes back at boot."""
    host = bench.hosts[0]
    good = host.slot("good")
    apply = bench.lab.start_on_operator(*bench.words("apply", "0.1.1"))
    wait_until("the switch", lambda: host.slot("current") != good)
    end(apply)
    host.cut_power()
    took = wait_until("it goes back at boot", lambda: host.slot("current") == good and host.is_up())
    wait_until("it is healthy", lambda: bench.is_well(host))
    show("power cut on trial: back at boot", after=f"{took:.1f}s", why=bench.status()[host.name]["failure"]["why"])


def interrupted(bench, kills, cuts, seed):
    """`apply` is killed, or a host loses its power, at random moments. The next `apply` ends in the wanted state."""
    chance = random.Random(seed)
    # Short waves: what matters is what they are in when it happens.
    bench.write_fleet(flight=6, soak_s=0, hold_s=2, at_once=2)
    applied(bench, "0.1.2")
    longest_s = applied(bench, "0.1.1")
    rows = []
    for nth in range(kills + cuts):
        version = ["0.1.2", "0.1.1"][nth % 2]
        apply = bench.lab.start_on_operator(*bench.words("apply", version))
        after_s = chance.uniform(0.0, longest_s)
        time.sleep(after_s)
        lost = None if nth < kills else chance.choice(bench.hosts)
        end(apply) if lost is None else lost.cut_power()
        met = phase(bench, version, lost)
        bench.assert_can_roll_back()
        if lost:
            apply.communicate(timeout=300)
            wait_until(f"{lost.name} is up", lost.is_up)
            bench.assert_can_roll_back()
        took_s = applied(bench, version)
        bench.assert_no_half_slots()
        what = "power of a host cut" if lost else "apply killed"
        rows.append((what, met, took_s))
        where = f", {lost.name}" if lost else ""
        show(f"{what} after {after_s:.1f} s{where}, {met}: the next apply ends well", took=f"{took_s:.1f}s")
    table(rows, longest_s)
    bench.write_fleet(flight=7)
    applied(bench, "0.1.2")


def applied(bench, version):
    """Applies a release, which must reach all hosts. Returns how long that took, in seconds."""
    start = time.monotonic()
    code, report, errors = bench.apply(version)
    took_s = time.monotonic() - start
    assert code == 0, (report, errors)
    bench.assert_all_run(version)
    return took_s


def phase(bench, version, lost):
    """Where the rollout was: at the host that was lost, or at all."""
    hosts = [lost] if lost else bench.hosts
    good = sum((it.slot("good") or "").startswith(version) for it in hosts)
    on_trial = sum(it.slot("current") != it.slot("good") for it in hosts)
    staged = sum(bool(list((it.root / "opt/muster/slots").glob(f"{version}-*"))) for it in hosts)
    if on_trial:
        return "a host on trial"
    if good == len(hosts):
        return "the host done" if lost else "all hosts done"
    if good:
        return "between two waves"
    return "before the first switch" if staged else "before the upload's end"


def table(rows, longest_s):
    print(f"\nmoments: uniform over the {longest_s:.0f} s of an undisturbed apply")
    line = "{:<20} {:<24} {:>5} {:>14} {:>13}".format
    print(line("what", "where it was", "times", "next apply, s", "longest, s"))
    for what, met in sorted({row[:2] for row in rows}):
        took = [it for *row, it in rows if tuple(row) == (what, met)]
        print(line(what, met, len(took), f"{statistics.median(took):.1f}", f"{max(took):.1f}"))
    print(flush=True)
