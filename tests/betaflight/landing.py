"""AUTO-LAND in flight: the receiver is lost at 10 m; how fast does the aircraft of physics.py come down?"""

import time

import firmware
from flight import BOX_FAILSAFE, LOW, Flight

PATH = firmware.program()
HOVER = 1443

print("| failsafe_throttle | stage 2 after ms | greatest climb above 10 m | on the ground after s | speed there m/s | disarmed after s |")
print("| --- | --- | --- | --- | --- | --- |")
for throttle in (1000, 1400, 1420, 1430, 1450):
    flight = Flight(PATH, [*firmware.lines("safe-sole.txt"), "set serial_update_rate_hz = 1000",
                           f"set failsafe_throttle = {throttle}", "set failsafe_landing_time = 15"], held=False)
    flight.sticks = [*LOW[:5], 1500, 1000, 1000]
    flight.arm()
    flight.run(1)
    end = time.monotonic() + 9
    while time.monotonic() < end:
        body = flight.physics.last()
        flight.sticks[2] = int(max(1250, min(1600, HOVER + 40 * (10 + body["z"]) + 60 * body["vz"])))
        flight.poll()
    last = flight.silence()
    stage_2 = flight.wait(lambda row: flight.mode(row, BOX_FAILSAFE), 3)
    disarmed = flight.wait(lambda row: not flight.armed(row), 20)
    rows = flight.physics.rows(last)
    before = next(((a, b) for a, b in zip(rows, rows[1:]) if a[7] < 0 and b[7] >= 0), None)  # column 7 is z, 10 vz
    climb = max(-row[7] for row in rows) - -rows[0][7]
    landed = f"{before[0][0] - last:.1f} | {before[0][10]:.1f}" if before else "not in time | -"
    print(f"| {throttle} | {(stage_2 - last) * 1000:.0f} | {climb:.2f} m from {-rows[0][7]:.1f} m | {landed} | "
          f"{f'{disarmed - last:.1f}' if disarmed else 'not in time'} |", flush=True)
    flight.stop()
