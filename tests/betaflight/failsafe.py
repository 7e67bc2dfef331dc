"""Claims about the failsafe, both receivers; exits with 1 if one fails. Armed, throttle 1,500, the aircraft held on the ground.

The receiver's loss is flagged within 200 ms of the last frame; stage 2 starts within 100 ms of failsafe_delay; and with frames
and the arm switch back as they were, nothing arms for a minute."""

import sys
import time

import firmware
from flight import BOX_FAILSAFE, LOW, Flight

PATH = firmware.program()
FLAGGED_S, STAGE_2_S, MINUTE_S = 0.2, 0.1, 60
RXLOSS = 2
DELAYS = (2, 4, 10)


def fly(base, delay):
    """Armed. Its `signal` keeps the receiver: MSP's sticks, or the pilot's radio."""
    lines = [*firmware.lines(f"safe-{base}.txt"), "set serial_update_rate_hz = 1000", f"set failsafe_delay = {delay}",
             "set failsafe_landing_time = 2"]
    flight = Flight(PATH, lines, pilot=list(LOW) if base == "override" else None)
    flight.arm(throttle=1500, switches=flight.pilot or flight.sticks)
    flight.run(0.5)
    return flight


def signal(flight, is_on):
    """Switches the receiver's signal. Returns when the last frame left, or now."""
    if not flight.pilot:
        flight.sending = is_on
    flight.radio_on = is_on
    time.sleep(0.002)
    return time.monotonic() if flight.pilot else flight.sent_at


def claim(holds, text):
    print(f"{'ok' if holds else 'FAILED'}: {text}", flush=True)
    if not holds:
        sys.exit(1)


def lose(base, delay):
    flight = fly(base, delay)
    last = signal(flight, False)
    flagged = flight.wait(lambda row: row[1] >> RXLOSS & 1, 3) - last
    stage_2 = flight.wait(lambda row: flight.mode(row, BOX_FAILSAFE), 3) - last
    claim(flagged <= FLAGGED_S, f"{base}, failsafe_delay = {delay}: RXLOSS after {1000 * flagged:.0f} ms")
    claim(abs(stage_2 - delay / 10) <= STAGE_2_S, f"{base}, failsafe_delay = {delay}: stage 2 after {1000 * stage_2:.0f} ms")
    return flight


def retried(work):
    """A firmware that stops answering, which it does now and then, is started again."""
    for _ in range(3):
        try:
            return work()
        except (ConnectionError, RuntimeError) as error:
            print(f"again: {error}", flush=True)
    raise RuntimeError("the firmware doesn't answer")


def stays_disarmed(base):
    flight = lose(base, DELAYS[-1])
    claim(flight.wait(lambda row: not flight.armed(row), 20), f"{base}: the landing's end disarms")
    signal(flight, True)
    (flight.pilot or flight.sticks)[2] = 1000
    armed = flight.wait(flight.armed, MINUTE_S)
    claim(armed is None, f"{base}: nothing arms for {MINUTE_S} s after the signal is back, the arm switch on")
    flight.stop()


for base in "sole", "override":
    for delay in DELAYS[:-1]:
        retried(lambda: lose(base, delay).stop())
    retried(lambda: stays_disarmed(base))
