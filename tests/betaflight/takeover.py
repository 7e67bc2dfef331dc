"""A pilot takes over from a drone's process that flies Betaflight, at random moments from take-off to landing.

usage: takeover.py PROGRAM MUSTER [RUNS [AT_ONCE]]
"""

import concurrent.futures
import csv
import json
import math
import pathlib
import random
import statistics
import subprocess
import sys
import tempfile

TAKEN = "its pilot took it over"
# It is noticed within this time.
NOTICED_S = 0.5
# The pilot takes over at least so long after it has left the ground and before it is down again.
MARGIN_S = 1


def flight(program, muster, seed, *settings):
    """Flies. Returns the report, and of each row of the tracks the time, the altitude and the state."""
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder) / "flight"
        command = [muster, "swarm", "betaflight-hover", "--firmware", program, "--seed", str(seed), "--out", folder]
        for setting in ("vehicle.receiver=override", *settings):
            command += ["--set", setting]
        done = subprocess.run(command, capture_output=True, text=True, timeout=300)
        if done.returncode not in (0, 4):
            raise RuntimeError(f"seed {seed}, {settings}: exit code {done.returncode}\n{done.stdout}{done.stderr}")
        report = json.loads((folder / "report.json").read_text())
        with open(folder / "tracks.csv") as file:
            rows = [(float(row["time_s"]), float(row["altitude_m"]), row["state"]) for row in csv.DictReader(file)]
    return report, rows


def take_over(program, muster, seed, at_s):
    """Seconds from the take-over until the swarm sees a landing; fails unless the aircraft is the pilot's, and stays down."""
    fault = f'faults=[{{ kind = "take-over", at_s = {at_s:.2f}, drone = 0 }}]'
    report, rows = flight(program, muster, seed, fault)
    lands = next((time for time, _, state in rows if state == "landing"), math.inf)
    why = report["drones"][0]["landed_because"]
    # A drone that begins to land before the take-over is noticed has another reason, or none.
    if report["violations"] or (why != TAKEN and lands > at_s + NOTICED_S):
        raise RuntimeError(f"seed {seed}, {at_s:.1f} s: {report['violations']}, {why}")
    seen = [time for time, _, state in rows if time >= at_s and state in ("landing", "landed", "finished")]
    # A drone that arms again climbs again.
    after = [altitude for time, altitude, _ in rows if time >= at_s]
    if not after:
        raise RuntimeError(f"seed {seed}, {at_s:.1f} s: it was down before: {why}")
    lowest = after.index(min(after))
    if max(after[lowest:]) > min(after) + 0.5:
        raise RuntimeError(f"seed {seed}, {at_s:.1f} s: it climbed again")
    return seen[0] - at_s


def main():
    program, muster = sys.argv[1:3]
    runs, at_once = (int(it) for it in (sys.argv[3:] + ["20", "1"][len(sys.argv) - 3:]))
    rng = random.Random(25)
    _, rows = flight(program, muster, 0)
    in_air = [time for time, altitude, _ in rows if altitude > 0.5]
    first_s, last_s = in_air[0] + MARGIN_S, in_air[-1] - MARGIN_S
    moments = [rng.uniform(first_s, last_s) for _ in range(runs)]
    delays_s = []
    with concurrent.futures.ThreadPoolExecutor(at_once) as pool:
        taken = pool.map(lambda seed: take_over(program, muster, seed, moments[seed - 1]), range(1, runs + 1))
        for seed, (at_s, after_s) in enumerate(zip(moments, taken), 1):
            delays_s.append(after_s)
            print(f"seed {seed}: taken over at {at_s:.1f} s, a landing for the swarm after {after_s:.2f} s", flush=True)
    print(f"{runs} of {runs} taken over; a landing for the swarm after {statistics.median(delays_s):.2f} s (median), {max(delays_s):.2f} s (longest)")


main()
