"""Flies the rigid body of physics.py by the firmware's own controllers and records steps of the sticks as CSV, its settings beside.

usage: step_response.py PROGRAM FILE
"""

import pathlib
import struct
import sys
import time

import firmware
import msp
import physics
from flight import LOW, Flight

EVERY = 20  # rows of the physics (1 ms each) a row of the file
COLUMNS = ("time_s", "phase", "stick_roll", "stick_pitch", "stick_throttle", "stick_yaw", "motor_fr", "motor_rl", "motor_fl", "motor_rr",
           "height_m", "climb_mps", "roll_deg", "pitch_deg", "yaw_deg", "p_dps", "q_dps", "r_dps")
HOVER = 1443
# ANGLE's target is angle_limit (60°) · rate(stick) / largest rate. With ACTUAL rates of 70 and 670 °/s and no expo, rate(x) is
# 70·x + 600·x², so that 0.377 of the stick is 10°; 0.2 of the yaw stick is 38 °/s.
TEN_DEGREES = 1500 + round(0.377 * 500)
CONFIGURATION = ["set roll_expo = 0", "set pitch_expo = 0", "set yaw_expo = 0", "set runaway_takeoff_prevention = OFF"]
SETTINGS = ("p_ i_ d_ d_min f_ angle_ iterm feedforward anti_gravity throttle_boost thrust_linear tpa_ rates_type roll_ pitch_ yaw_ "
            "thr_ gyro_lpf dterm_lpf dyn_notch simplified pid_process_denom rc_smoothing motor_idle dshot_idle").split()
# Phase, seconds, sticks that differ from hover. `None` throttle: held at the height by the script.
PHASES = [("climb", 3.0, {"throttle": None}), ("hover", 2.0, {"throttle": None}),
          ("roll 10", 1.0, {"roll": TEN_DEGREES}), ("roll 0", 1.5, {}),
          ("pitch 10", 1.0, {"pitch": TEN_DEGREES}), ("pitch 0", 1.5, {"throttle": None}),
          ("yaw", 1.0, {"yaw": 1600}), ("yaw 0", 1.0, {"throttle": None}),
          ("throttle up", 0.7, {"throttle": HOVER + 60}), ("throttle back", 1.0, {}), ("settle", 2.0, {"throttle": None})]


def height_hold(body):
    return int(max(1200, min(1650, HOVER + 60 * (5 + body["z"]) + 70 * body["vz"])))


path, file = firmware.program(), pathlib.Path(sys.argv[2])
flight = Flight(path, [*firmware.lines("safe-sole.txt"), "set serial_update_rate_hz = 1000", *CONFIGURATION], held=False)
flight.sticks = [*LOW[:5], 1500, 1000, 1000]
flight.arm()
flight.run(1)
marks = []  # (time, phase, sticks)
for phase, seconds, change in PHASES:
    end = time.monotonic() + seconds
    throttle = change.get("throttle", flight.sticks[2] if phase not in ("throttle back",) else HOVER)
    while time.monotonic() < end:
        wanted = height_hold(flight.physics.last()) if throttle is None else throttle
        flight.sticks[:4] = [change.get("roll", 1500), change.get("pitch", 1500), wanted, change.get("yaw", 1500)]
        if not marks or marks[-1][1:] != (phase, tuple(flight.sticks[:4])):
            marks.append((time.monotonic(), phase, tuple(flight.sticks[:4])))
        time.sleep(0.005)
rows = flight.physics.rows(marks[0][0])
ends = marks[-1][0] + PHASES[-1][1]
attitude, body = struct.unpack("<3h", flight.ask(msp.ATTITUDE)), flight.physics.last()
print(f"MSP_ATTITUDE {attitude}; roll, pitch, yaw of the body in degrees: {[round(body[n] * 57.29578, 1) for n in ('roll', 'pitch', 'yaw')]}")
flight.sending = False
flight.link.close()
flight.firmware.start()  # the CLI doesn't answer in flight
dump = flight.firmware.cli(["dump"])[0].splitlines()
flight.stop()
settings = [line.strip() for line in dump if line.startswith(tuple("set " + name for name in SETTINGS))]
file.with_suffix(".txt").write_text("\n".join(settings) + "\n")

text, mark, start = [",".join(COLUMNS)], 0, marks[0][0]
for row in rows[::EVERY]:
    seen = dict(zip(physics.COLUMNS, row))
    if seen["time"] > ends:
        break
    while mark + 1 < len(marks) and marks[mark + 1][0] <= seen["time"]:
        mark += 1
    degrees = [f"{seen[name] * 57.29578:.2f}" for name in ("roll", "pitch", "yaw", "p", "q", "r")]
    motors = [f"{seen[name]:.3f}" for name in ("front_right", "rear_left", "front_left", "rear_right")]
    text.append(",".join([f"{seen['time'] - start:.3f}", marks[mark][1], *map(str, marks[mark][2]), *motors,
                          f"{-seen['z']:.3f}", f"{-seen['vz']:.3f}", *degrees]))
file.write_text("\n".join(text) + "\n")
print(f"{len(text) - 1} rows, {file.stat().st_size} bytes")
