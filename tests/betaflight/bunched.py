"""How far a step of the roll stick tilts the aircraft when its RC frame follows the one before too soon, as when a line delivers two
at once: with Betaflight's defaults, and with the settings that drones fly with.
"""

import math
import statistics
import time

import firmware
import msp
from flight import LOW, Flight

PATH = firmware.program()
REPEATS = 10
HOVER = 1443
PERIOD = 0.02
STEP = 112  # µs: 4° of tilt; a drone's sticks moved so far in one period of a hover


def height_hold(body):
    return int(max(1200, min(1650, HOVER + 60 * (5 + body["z"]) + 70 * body["vz"])))


def fly(flight, sticks_at, seconds):
    """Frames at the times and with the roll of `sticks_at(number)`, in seconds from now; holds the height. The largest roll."""
    start, number, largest = time.monotonic(), 0, 0.0
    while time.monotonic() < start + seconds:
        at, roll = sticks_at(number)
        while time.monotonic() < start + at:
            largest = max(largest, abs(flight.physics.last()["roll"]))
            time.sleep(0.0002)
        channels = [roll, 1500, height_hold(flight.physics.last()), *flight.sticks[3:]]
        flight.link.send(msp.frame(msp.SET_RAW_RC, msp.channels_payload(channels)))
        number += 1
    return math.degrees(largest)


print("| angle_feedforward | angle_p_gain | ms between the frames | n | tilt °, median | worst |\n| --- | --- | --- | --- | --- | --- |")
for feedforward, gain in (50, 50), (0, 80):
    flight = Flight(PATH, [*firmware.lines("safe-sole.txt"), "set serial_update_rate_hz = 1000", "set runaway_takeoff_prevention = OFF",
                           f"set angle_feedforward = {feedforward}", f"set angle_p_gain = {gain}"], held=False)
    flight.sticks = [*LOW[:5], 1500, 1000, 1000]
    flight.arm()
    flight.silence()
    fly(flight, lambda number: (number * PERIOD, 1500), 5)
    for gap in 0.02, 0.005, 0.002, 0.001:
        tilts = []
        for _ in range(REPEATS):
            tilts.append(fly(flight, lambda number: ((number - 1) * PERIOD + gap, 1500 + STEP) if number else (0, 1500), 0.5))
            fly(flight, lambda number: (number * PERIOD, 1500), 1.5)
        print(f"| {feedforward} | {gain} | {gap * 1000:.0f} | {REPEATS} | {statistics.median(tilts):.1f} | {max(tilts):.1f} |", flush=True)
    flight.stop()
