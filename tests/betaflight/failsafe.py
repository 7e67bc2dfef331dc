"""Claims about the failsafe of a sole receiver; exits with 1 if one fails. Armed, throttle 1,500, the aircraft held on the ground.

The receiver's loss is flagged within 200 ms of the last frame; stage 2 starts within 100 ms of failsafe_delay; and with frames
and the arm switch back as they were, nothing arms for a minute. The simulation can't lose a pilot's radio: its frames count
for ever."""

import sys

import firmware
from flight import BOX_FAILSAFE, Flight

PATH = firmware.program()
FLAGGED_S, STAGE_2_S, MINUTE_S = 0.2, 0.1, 60
RXLOSS = 2
DELAYS = (2, 4, 10)


def claim(holds, text):
    print(f"{'ok' if holds else 'FAILED'}: {text}", flush=True)
    if not holds:
        sys.exit(1)


def lose(delay):
    """A flight in stage 2."""
    lines = [*firmware.lines("safe-sole.txt"), "set serial_update_rate_hz = 1000", f"set failsafe_delay = {delay}",
             "set failsafe_landing_time = 2"]
    flight = Flight(PATH, lines)
    flight.arm(throttle=1500)
    flight.run(0.5)
    last = flight.silence()
    flagged = flight.wait(lambda row: row[1] >> RXLOSS & 1, 3)
    stage_2 = flight.wait(lambda row: flight.mode(row, BOX_FAILSAFE), 3)
    claim(flagged and stage_2, f"failsafe_delay = {delay}: the loss is noticed")
    claim(flagged - last <= FLAGGED_S, f"failsafe_delay = {delay}: RXLOSS after {1000 * (flagged - last):.0f} ms")
    claim(abs(stage_2 - last - delay / 10) <= STAGE_2_S, f"failsafe_delay = {delay}: stage 2 after {1000 * (stage_2 - last):.0f} ms")
    return flight


def stays_disarmed():
    flight = lose(DELAYS[-1])
    claim(flight.wait(lambda row: not flight.armed(row), 20), "the landing's end disarms")
    flight.sticks[2], flight.sending = 1000, True
    armed = flight.wait(flight.armed, MINUTE_S)
    claim(armed is None, f"nothing arms for {MINUTE_S} s after the signal is back, the arm switch on")
    flight.stop()


def retried(work):
    """A firmware that stops answering, which it does now and then, is started again."""
    for _ in range(3):
        try:
            return work()
        except (ConnectionError, RuntimeError) as error:
            print(f"again: {error}", flush=True)
    raise RuntimeError("the firmware doesn't answer")


for delay in DELAYS[:-1]:
    retried(lambda: lose(delay).stop())
retried(stays_disarmed)
