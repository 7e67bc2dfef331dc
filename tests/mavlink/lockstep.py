"""`lockstep.py MUSTER MUSTERD`: a scripted autopilot flies thesis-1's first two waypoints in lockstep with four simulated drones.

Five musterd on loopback in real time. Each leg must have ended before the next begins. Then all are recalled and land.
"""

import csv
import json
import math
import pathlib
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time

from autopilot import Autopilot

MUSTER, MUSTERD = sys.argv[1:3]
DRONES, LEADER, PILOTED = 5, 2, 0
EARTH_M = 6_371_000
REACHED_M = 1.0  # muster's radius of arrival


def prepare(folder):
    """Files of five drones, the first one with an autopilot. Returns that one's address."""
    subprocess.run([MUSTER, "swarm", "thesis-1", "--prepare", folder], check=True, stdout=subprocess.DEVNULL)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        companion = f"127.0.0.1:{free.getsockname()[1]}"
    for drone in range(DRONES):
        path = folder / f"drone-{drone}/drone.toml"
        text = path.read_text().replace('log = "human"', 'log = "json"')
        if drone == PILOTED:
            text = text.replace('vehicle = "closed-form"', f'vehicle = "mavlink"\nport = "udpin:{companion}"')
        path.write_text(text)
    return companion


def origin(folder):
    """Where the drone starts: the mission's home, and its place in a simulation."""
    out = folder / "simulated"
    subprocess.run([MUSTER, "sim", "thesis-1", "--out", out], check=True, stdout=subprocess.DEVNULL)
    rows = csv.DictReader((out / "tracks.csv").open())
    first = next(row for row in rows if int(row["drone"]) == PILOTED)
    plan = json.loads((folder / "scenario/albufera.plan").read_text())
    latitude, longitude, altitude_m = plan["mission"]["plannedHomePosition"]
    north, east = math.degrees(float(first["north_m"]) / EARTH_M), math.degrees(float(first["east_m"]) / EARTH_M)
    return latitude + north, longitude + east / math.cos(math.radians(latitude)), altitude_m


class Drone:
    """A process, and the events of its mission with the time of each."""

    def __init__(self, folder, number):
        command = [MUSTERD, "--config", folder / f"drone-{number}/drone.toml", *(["--fly"] if number == LEADER else [])]
        self.process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
        self.events, self.ended = [], None
        threading.Thread(target=self.read, daemon=True).start()

    def read(self):
        for line in self.process.stderr:
            seen = json.loads(json.loads(line).get("seen", "{}"))
            if "Mission" in seen:
                self.events.append((time.monotonic(), seen["Mission"]))

    def at(self, event):
        return next((at for at, seen in self.events if seen == event), None)


def wait(what, condition, limit_s=300):
    began = time.monotonic()
    while not condition():
        assert time.monotonic() - began < limit_s, f"never: {what}"
        time.sleep(0.05)


def main():
    folder = pathlib.Path(tempfile.mkdtemp())
    companion = prepare(folder)
    autopilot = Autopilot(origin(folder), companion)
    autopilot.start()
    drones = [Drone(folder, number) for number in range(DRONES) if number != LEADER]
    drones.insert(LEADER, Drone(folder, LEADER))
    try:
        for waypoint in (1, 2):
            moving = {"State": {"MovingToWaypoint": {"waypoint": waypoint}}}
            reached = {"State": {"WaypointReached": {"waypoint": waypoint}}}
            try:
                wait(f"all at waypoint {waypoint}", lambda: all(drone.at(reached) for drone in drones))
            except AssertionError:
                print(f"autopilot: {vars(autopilot)}", *(drone.events[-1] for drone in drones), sep="\n")
                raise
            begins = [drone.at(moving) for drone in drones]
            print(f"waypoint {waypoint}: began within {max(begins) - min(begins):.2f} s", flush=True)
            before = {"State": {"WaypointReached": {"waypoint": waypoint - 1}}}
            if all(drone.at(before) for drone in drones):
                assert min(begins) >= max(drone.at(before) for drone in drones), "not in lockstep"
        assert all(left_m < REACHED_M for _, left_m in autopilot.legs), autopilot.legs
        for drone in drones:
            drone.process.send_signal(signal.SIGTERM)
        wait("the autopilot has landed", lambda: not autopilot.armed)
        codes = [drone.process.wait(120) for drone in drones]
        print(f"{len(autopilot.legs)} legs; commands: {', '.join(dict.fromkeys(autopilot.commands))}; exit codes {codes}")
    finally:
        for drone in drones:
            drone.process.kill()


main()
