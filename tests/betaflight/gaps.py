"""Which gap between two RC frames the firmware takes for a lost receiver, armed and as sole receiver."""

import time

import firmware
from flight import FLAGS, Flight, flag_names

PATH = firmware.program()
REPEATS = 10
RXLOSS = 1 << FLAGS.index("RXLOSS")

flight = Flight(PATH, [*firmware.lines("safe-sole.txt"), "set serial_update_rate_hz = 1000"])
flight.arm(throttle=1500)
flight.run(1)
print("| gap, and up to 20 ms more, ms | n | RXLOSS seen | motors changed |\n| --- | --- | --- | --- |")
for gap in (60, 100, 120, 140, 160, 200, 300, 400):
    lost = changed = 0
    for _ in range(REPEATS):
        flight.wait(lambda row: row[1] == 0, 5)
        first = len(flight.seen)
        last = flight.silence()
        time.sleep(max(0.0, last + gap / 1000 - time.monotonic() - 0.001))
        flight.sending = True
        flight.run(0.3)
        lost += any(row[1] & RXLOSS for row in flight.seen[first:])
        motors = [sum(row[1:5]) / 4 for row in flight.physics.rows(last)]
        changed += any(abs(value - motors[0]) > 0.02 for value in motors)
    print(f"| {gap} | {REPEATS} | {lost} | {changed} |", flush=True)
print(f"armed at the end: {flight.armed(flight.seen[-1])}, flags {flag_names(flight.seen[-1][1])}")
flight.stop()
