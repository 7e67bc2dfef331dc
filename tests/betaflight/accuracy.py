"""How well a drone's process flies Betaflight, beside our simulated controller: hover, hover in gusts and a square, by the truth
about the aircraft. Prints the median and the worst of each figure; fails if a flight of Betaflight misses what is demanded, or
if medians that the simulation is to predict differ by more than a fifth. A flight in which the host let the firmware or its aircraft
stand still tells nothing about either: it is named, and flown again.

usage: accuracy.py PROGRAM MUSTER [RUNS [AT_ONCE [FLIGHT ...]]]; FLIGHT: hover, gusts or square
"""

import concurrent.futures
import csv
import json
import math
import pathlib
import statistics
import subprocess
import sys
import tempfile

HEIGHT = 2.0
SIDE = 10.0
CORNERS = (0, 0), (SIDE, 0), (SIDE, SIDE), (0, SIDE), (0, 0)
GUSTS = ("--set", "aircraft.gusts_mps=1")
# Flight, scenario, options, largest value of each figure.
FLIGHTS = (
    ("hover", "betaflight-hover", (), {"horizontal RMS m": 0.15, "horizontal max m": 0.5, "vertical RMS m": 0.15,
                                       "vertical max m": 0.5, "landing m/s": 0.6, "landed off m": 0.5}),
    ("gusts", "betaflight-hover", GUSTS, {"horizontal RMS m": 0.4, "vertical RMS m": 0.4}),
    ("square", "betaflight-square", (), {"cross-track p95 m": 0.5, "overshoot m": 0.6, "landing m/s": 0.6,
                                         "landed off m": 0.5}),
)
# Figures that the simulated controller predicts, and by which share of Betaflight's their medians may differ.
PREDICTED, SHARE = {("hover", "horizontal RMS m"), ("square", "cross-track p95 m")}, 0.2

# Longest stall of the firmware in a flight that counts, in seconds, and how often one that doesn't is flown again.
STALL_MAX, AGAIN_MAX = 0.05, 2
STALL = "longest stall ms"


def rows(folder):
    """Time, north, east, altitude and state, ten a second."""
    with open(folder / "tracks.csv") as file:
        return [(float(row["time_s"]), float(row["north_m"]), float(row["east_m"]), float(row["altitude_m"]), row["state"])
                for row in csv.DictReader(file)]


def rms(values):
    return math.sqrt(statistics.fmean(value * value for value in values))


def landing(flight):
    """Fastest descent in 0.5 s below 0.5 m, and the distance of the last place from home."""
    low = [(time, altitude) for time, _, _, altitude, state in flight if state == "landing" and altitude < 0.5]
    speeds = [(before[1] - after[1]) / (after[0] - before[0]) for before, after in zip(low, low[5:])]
    return {"landing m/s": max(speeds), "landed off m": math.hypot(*flight[-1][1:3])}


def hover(flight):
    held = [row for row in flight if row[4] == "waypoint 0 reached"]
    if held[-1][0] - held[0][0] < 59:
        raise ValueError(f"held for {held[-1][0] - held[0][0]:.1f} s only")
    level = [math.hypot(north, east) for _, north, east, _, _ in held]
    height = [altitude - HEIGHT for _, _, _, altitude, _ in held]
    return {"horizontal RMS m": rms(level), "horizontal max m": max(level), "vertical RMS m": rms(height),
            "vertical max m": max(map(abs, height)), **landing(flight)}


def to_side(north, east, start, end):
    along = ((north - start[0]) * (end[0] - start[0]) + (east - start[1]) * (end[1] - start[1])) / SIDE**2
    share = min(1.0, max(0.0, along))
    return math.hypot(north - start[0] - share * (end[0] - start[0]), east - start[1] - share * (end[1] - start[1]))


def square(flight):
    legs = [row for row in flight if row[4].startswith("moving to waypoint")]
    off = sorted(min(to_side(north, east, *side) for side in zip(CORNERS, CORNERS[1:])) for _, north, east, _, _ in legs)
    beyond = max(max(-place, place - SIDE) for row in legs for place in row[1:3])
    return {"cross-track p95 m": off[int(0.95 * len(off))], "overshoot m": max(0.0, beyond), **landing(flight)}


def stall(folder):
    """The longest time for which the firmware stood still, in seconds; 0 of our simulation, or without a report."""
    report = folder / "report.json"
    stalls = json.loads(report.read_text()).get("firmware_stalls") if report.exists() else None
    return stalls["longest_s"] if stalls else 0


def fly(command, figures):
    """The figures of one flight, or what it printed if it failed."""
    for again in range(AGAIN_MAX + 1):
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder) / "flight"
            done = subprocess.run([*command, "--out", folder], capture_output=True, text=True, timeout=300)
            command_line = " ".join(map(str, command))
            stood = stall(folder)
            if stood > STALL_MAX:
                print(f"{command_line}: the host stood still for {1e3 * stood:.0f} ms", file=sys.stderr)
            elif done.returncode != 0:
                return f"{command_line} ends with {done.returncode}:\n{done.stdout}{done.stderr}"
            else:
                return {**figures(rows(folder)), STALL: 1e3 * stood}
    return f"{command_line}: the host stood still in each of {AGAIN_MAX + 1} flights"


def main():
    program, muster = sys.argv[1:3]
    runs, at_once = (int(it) for it in (sys.argv[3:5] + ["20", "1"][len(sys.argv[3:5]):]))
    names = [name for name, *_ in FLIGHTS]
    wanted = sys.argv[5:] or names
    if not set(wanted) <= set(names):
        print(f"no such flight: {wanted}; one of {names}", file=sys.stderr)
        sys.exit(2)
    pool = concurrent.futures.ThreadPoolExecutor(at_once)
    print(f"{runs} flights each, seeds 1 to {runs}\n")
    print("| flight | figure | at most | Betaflight median | worst | simulated median | worst |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    failures = []
    for flight, scenario, options, limits in (it for it in FLIGHTS if it[0] in wanted):
        figures = square if flight == "square" else hover
        each = []
        for kind in (["swarm", scenario, "--firmware", program], ["sim", scenario]):
            commands = [[muster, *kind, "--seed", str(seed), *options] for seed in range(1, runs + 1)]
            flights = []
            for flown in pool.map(lambda command: fly(command, figures), commands):
                (failures if isinstance(flown, str) else flights).append(flown)
                print(f"\r{flight}: {kind[0]} {len(flights)} of {runs}", end="\r", file=sys.stderr)
            if not flights:
                sys.exit("\n".join(failures))
            each.append(flights)
        for name, limit in limits.items():
            cells = [f(one[name] for one in flights) for flights in each for f in (statistics.median, max)]
            print(f"| {flight} | {name} | {limit} | " + " | ".join(f"{cell:.3f}" for cell in cells) + " |", flush=True)
            failures += [f"{flight}: {name} {one[name]:.3f} in a flight of Betaflight with stalls of {one[STALL]:.0f} ms at most"
                         for one in each[0] if one[name] > limit]
            if (flight, name) in PREDICTED and abs(cells[2] / cells[0] - 1) > SHARE:
                failures.append(f"{flight}: the simulated median differs by {cells[2] / cells[0] - 1:+.0%}: {name}")
    sys.exit("\n".join(failures) or 0)


main()
