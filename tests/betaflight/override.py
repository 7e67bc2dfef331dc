"""Override: a pilot's radio (UDP 9004) keeps ARM and the modes, MSP replaces the sticks while AUX3 is high."""

import statistics
import time

import firmware
import msp
from flight import BOX_OVERRIDE, LOW, Flight, flag_names

PATH = firmware.program()
REPEATS = 10
OVERRIDE, AUX1 = 6, 4  # index of AUX3 and AUX1 in a frame
# MSP_RC's order is roll, pitch, yaw, throttle.
ROLL, THROTTLE = 0, 3


def fly(configuration=(), pilot_first=True):
    """Armed by the pilot with throttle 1,200; MSP sticks differ from the pilot's in roll and throttle."""
    flight = Flight(PATH, [*firmware.lines("safe-override.txt"), "set serial_update_rate_hz = 1000", *configuration], pilot=list(LOW))
    flight.sticks = [1600, 1500, 1400, 1500]
    flight.arm(throttle=1200, switches=flight.pilot)
    return flight


def armed(flight):
    return "armed" if flight.armed(flight.seen[-1]) else "disarmed"


def times(values):
    known = [value * 1000 for value in values if value is not None]
    return f"n {len(known)} of {len(values)}, median {statistics.median(known):.0f} ms, max {max(known):.0f} ms" if known else "never"


def switch(flight, value, condition):
    """Seconds from the pilot's switch until `condition(row)`."""
    flight.pilot[OVERRIDE] = value
    began = time.monotonic()
    at = flight.wait(condition, 2)
    flight.run(0.2)
    return at and at - began


flight = fly()
on, off, bit_off = [], [], []
for _ in range(REPEATS):
    on.append(switch(flight, 1800, lambda row: row[3][ROLL] == 1600 and row[3][THROTTLE] == 1400 and flight.mode(row, BOX_OVERRIDE)))
    off.append(switch(flight, 1000, lambda row: row[3][ROLL] == 1500 and row[3][THROTTLE] == 1200))
    switch(flight, 1800, lambda row: flight.mode(row, BOX_OVERRIDE))
    bit_off.append(switch(flight, 1000, lambda row: not flight.mode(row, BOX_OVERRIDE)))
print(f"override switched on → MSP sticks in MSP_RC and the mode bit: {times(on)}")
print(f"override switched off → the pilot's sticks in MSP_RC: {times(off)}")
print(f"override switched off → the mode bit is 0: {times(bit_off)}")

for failsafe in ("OFF", "ON"):
    if failsafe == "ON":
        flight.stop()
        flight = fly(["set msp_override_failsafe = ON"])
    switch(flight, 1800, lambda row: row[3][THROTTLE] == 1400)
    last, first = flight.silence(), len(flight.seen)
    changed = flight.wait(lambda row: row[3][THROTTLE] != 1400 or row[3][ROLL] != 1600, 20)
    rows = flight.seen[first:]
    flags = sorted({name for row in rows for name in flag_names(row[1])})
    print(f"MSP sender stops, msp_override_failsafe = {failsafe}: sticks of the last frame "
          f"{'fell back after %.0f ms' % ((changed - last) * 1000) if changed else 'held for the 20 s of the test'}; "
          f"flags {' '.join(flags) or 'none'}; {armed(flight)}; mode bit {int(flight.mode(rows[-1], BOX_OVERRIDE))}")
    took = switch(flight, 1000, lambda row: row[3][ROLL] == 1500 and row[3][THROTTLE] == 1200)
    print(f"  then the pilot switches override off: the pilot's sticks after {took * 1000:.0f} ms")
    flight.sending = True

flight.run(0.5)
switch(flight, 1800, lambda row: row[3][THROTTLE] == 1400)
pilot, flight.pilot = flight.pilot, None
began = time.monotonic()
lost = flight.wait(lambda row: row[1] != 0 or not flight.armed(row), 5)
print(f"the pilot's radio (UDP 9004) stops, MSP goes on: {'flags after %.0f ms' % ((lost - began) * 1000) if lost else 'no flag in 5 s'}")
flight.stop()

flight = Flight(PATH, [*firmware.lines("safe-override.txt"), "set serial_update_rate_hz = 1000"], pilot=list(LOW))
flight.sending = flight.radio_on = False
flight.firmware.start()  # anew: it has never had an MSP frame
flight.link = msp.Link()
flight.run(3)
flight.radio_on, flight.pilot[OVERRIDE] = True, 1800
if not flight.wait(lambda row: row[3][OVERRIDE] == 1800, 5):
    raise RuntimeError("the firmware doesn't take the pilot's frames")
flight.run(0.5)
print(f"override on before any MSP frame: roll, pitch, yaw, throttle = {flight.seen[-1][3][:4]}")
flight.sending, flight.sticks = True, [1600, 1500]
flight.run(0.5)
print(f"MSP frames of two channels (1600, 1500): roll, pitch, yaw, throttle = {flight.seen[-1][3][:4]}")
flight.stop()

for mask, what in ((15, "ARM not in the mask"), (31, "ARM (AUX1, bit 4) in the mask")):
    flight = Flight(PATH, [*firmware.lines("safe-override.txt"), "set serial_update_rate_hz = 1000",
                           f"set msp_override_channels_mask = {mask}"], pilot=list(LOW))
    flight.pilot[OVERRIDE] = 1800
    flight.wait(lambda row: row[1] == 0, 12)
    flight.sticks = [1500, 1500, 1000, 1500, 1800]
    flight.wait(flight.armed, 2)
    print(f"{what}: pilot's AUX1 low, MSP's high → {armed(flight)}")
    flight.sticks[AUX1] = 1000
    flight.run(0.5)
    flight.pilot[AUX1] = 1800
    flight.run(1)
    print(f"{what}: pilot's AUX1 high, MSP's low → {armed(flight)}")
    flight.sticks[AUX1] = 1800
    flight.run(0.5)
    flight.pilot[AUX1] = 1000
    flight.run(0.5)
    print(f"{what}: both high, then the pilot's low → {armed(flight)}")
    flight.stop()
