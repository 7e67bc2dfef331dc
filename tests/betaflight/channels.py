"""Sole receiver, armed: what values outside 885 to 2,115 µs do, and frames that lack channels. Each for 1.5 s."""

import firmware
from flight import Flight, flag_names

PATH = firmware.program()
FLYING = [1500, 1500, 1500, 1500, 1800, 1500, 1000, 1000]


def changed(index, value):
    return [value if at == index else old for at, old in enumerate(FLYING)]


CASES = [("as flying", FLYING)]
CASES += [(f"throttle {value}", changed(2, value)) for value in (0, 884, 885, 2115, 2116, 65535)]
CASES += [(f"roll {value}", changed(0, value)) for value in (0, 2116)]
CASES += [(f"AUX4 {value}", changed(7, value)) for value in (0, 2116)]
CASES += [("AUX1 (arm) 0", changed(4, 0)), ("4 channels", FLYING[:4]), ("no channel", []), ("18 channels", FLYING + [1500] * 10)]

print("| frame | roll, pitch, yaw, throttle, AUX1 … AUX4 in MSP_RC | flags | armed |\n| --- | --- | --- | --- |")
flight = None
for name, sticks in CASES:
    if not flight:
        flight = Flight(PATH, [*firmware.lines("safe-sole.txt"), "set serial_update_rate_hz = 1000", "set failsafe_delay = 50"])
        flight.arm(throttle=1500)
    flight.sticks = list(FLYING)
    flight.run(1)
    flight.sticks = sticks
    flight.run(1.5)
    row = flight.seen[-1]
    print(f"| {name} | {', '.join(map(str, row[3][:8]))} | {' '.join(flag_names(row[1])) or 'none'} | "
          f"{'yes' if flight.armed(row) else 'no'} |", flush=True)
    if not flight.armed(row):
        flight.stop()
        flight = None
if flight:
    flight.stop()
