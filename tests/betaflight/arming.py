"""What arms, what doesn't, by which flag; and what prevents arming after the receiver was lost."""

import math
import time

import firmware
from flight import FLAGS, LOW, Flight, flag_names

PATH = firmware.program()
AUX1, AUX2, AUX3 = 4, 5, 6


def flight_with(*configuration):
    return Flight(PATH, [*firmware.lines("safe-sole.txt"), "set serial_update_rate_hz = 1000", *configuration])


def changes(flight, since):
    """The arming flags over time, as they change: seconds after `since`."""
    before, text = None, []
    for at, flags, _, _ in flight.seen:
        if at >= since and flags != before:
            text.append(f"{at - since:.2f} s {'+'.join(flag_names(flags)) or 'none'}")
            before = flags
    return ", ".join(text)


def attempt(flight, what, prepare, undo=lambda: None):
    """Raises the arm switch under a condition; prints whether it arms and which flags show before and after."""
    prepare()
    flight.run(1)
    before = flag_names(flight.seen[-1][1])
    flight.sticks[AUX1] = 1800
    flight.run(0.7)
    row = flight.seen[-1]
    numbered = [f"{name} ({FLAGS.index(name)})" for name in flag_names(row[1])]
    print(f"| {what} | {' '.join(before) or 'none'} | {'armed' if flight.armed(row) else 'not armed'} | {' '.join(numbered) or 'none'} |", flush=True)
    flight.sticks = list(LOW)
    undo()
    flight.run(1)


def stick(flight, index, value):
    return lambda: flight.sticks.__setitem__(index, value)


print("| condition, then AUX1 high | flags before | result | flags (bit) |\n| --- | --- | --- | --- |")
flight = flight_with("set auto_disarm_delay = 5")
attempt(flight, "within 5 s of the start", lambda: None)
flight.wait(lambda row: row[1] == 0, 10)
attempt(flight, "none", lambda: None)
for throttle in (1049, 1050, 1051):
    attempt(flight, f"throttle {throttle} (min_check = 1050)", stick(flight, 2, throttle))
attempt(flight, "ANGLE on", stick(flight, AUX2, 1500))
attempt(flight, "roll 24° (small_angle = 25)", lambda: setattr(flight.physics.tilt, "value", math.radians(24)),
        lambda: setattr(flight.physics.tilt, "value", 0.0))
attempt(flight, "roll 26°", lambda: setattr(flight.physics.tilt, "value", math.radians(26)),
        lambda: setattr(flight.physics.tilt, "value", 0.0))
attempt(flight, "no RC frames for 1 s", lambda: setattr(flight, "sending", False), lambda: setattr(flight, "sending", True))
attempt(flight, "AUX1 high when RC frames come back", lambda: (setattr(flight, "sending", False), time.sleep(1), stick(flight, AUX1, 1800)(),
                                                               setattr(flight, "sending", True)))
attempt(flight, "yaw 2,000, throttle low (no stick arming with a switch)", stick(flight, 3, 2000))
flight.stop()

flight = flight_with("aux 2 27 2 1700 2100 0 0", "aux 3 36 3 1700 2100 0 0")
flight.wait(lambda row: not row[1] & ~(1 << FLAGS.index("NOPREARM")), 12)
attempt(flight, "PREARM configured, off", lambda: None)
attempt(flight, "FAILSAFE mode on (AUX3)", lambda: (stick(flight, AUX3, 1800)(), stick(flight, 7, 1800)()))
attempt(flight, "PREARM on (AUX4)", stick(flight, 7, 1800))
flight.stop()

flight = flight_with("set motor_pwm_protocol = DISABLED")
flight.run(6)
attempt(flight, "motor_pwm_protocol = DISABLED", lambda: None)
flight.stop()

flight = flight_with("aux 0 0 0 900 900 0 0")
flight.wait(lambda row: row[1] == 0, 12)
attempt(flight, "no ARM range at all, yaw 2,000 and throttle low", stick(flight, 3, 2000))
flight.stop()

def after_loss(procedure, recovery, observe):
    flight = flight_with(f"set failsafe_procedure = {procedure}", f"set failsafe_recovery_delay = {recovery}")
    try:
        flight.arm(throttle=1500)
        flight.run(1)
        flight.silence()
        flight.run(3)
        flight.sticks[2] = 1000
        flight.sending, back = True, time.monotonic()
        flight.run(observe)
        row = flight.seen[-1]
        print(f"- {procedure}, failsafe_recovery_delay = {recovery}: {changes(flight, back)}; "
              f"{'armed' if flight.armed(row) else 'disarmed'} after {observe} s", flush=True)
        if not flight.armed(row):
            flight.sticks[AUX1], low = 1000, time.monotonic()
            flight.run(1)
            flight.sticks[AUX1], high = 1800, time.monotonic()
            armed = flight.wait(flight.armed, 2)
            print(f"  switch low: {changes(flight, low)}; high: {'armed after %.0f ms' % ((armed - high) * 1000) if armed else 'not armed'}", flush=True)
    finally:
        flight.stop()


print("\n## After a loss of 3 s while armed, throttle 1,500; the arm switch stays high")
for case in (("DROP", 5, 60), ("DROP", 20, 6), ("AUTO-LAND", 5, 6)):
    while True:
        try:
            after_loss(*case)
            break
        except (ConnectionError, RuntimeError) as error:
            print(f"  done again: {error}")
