"""Claims about the failsafe of a sole receiver; exits with 1 if one fails. Arguments: PROGRAM (printed by .ci/betaflight) and MUSTER.

Armed, throttle 1,500, the aircraft held on the ground: the receiver's loss is flagged within 200 ms of the last frame; stage 2
starts within 100 ms of failsafe_delay; and with frames and the arm switch back as they were, nothing arms for a minute. The
simulation can't lose a pilot's radio: its frames count for ever. Then the same three times of the firmware and of `muster fc
simulate`, seen by the same client: their medians differ by at most a fifth."""

import os
import statistics
import subprocess
import sys

import firmware
from flight import BOX_FAILSAFE, Flight

PATH = firmware.program()
MUSTER = os.path.abspath(sys.argv[2])
FLAGGED_S, STAGE_2_S, MINUTE_S = 0.2, 0.1, 60
RXLOSS, THROTTLE = 2, 3
DELAYS = (2, 4, 10)
REPEATS, SHARE = 9, 0.2
TIMES = "RXLOSS", "throttle's rxfail value", "stage 2"


def claim(holds, text):
    print(f"{'ok' if holds else 'FAILED'}: {text}", flush=True)
    if not holds:
        sys.exit(1)


class Simulation:
    """`muster fc simulate` in the firmware's place: failsafe_delay = 4, and nothing to configure."""

    def __init__(self, path, _):
        self.command = [path, "fc", "simulate", "--listen", "127.0.0.1:5761"]
        self.start()

    def start(self):
        self.process = subprocess.Popen(self.command, stdout=subprocess.PIPE, text=True)
        self.process.stdout.readline()

    def stop(self):
        self.process.kill()
        self.process.wait()


def configuration(delay):
    return [*firmware.lines("safe-sole.txt"), "set serial_update_rate_hz = 1000", f"set failsafe_delay = {delay}",
            "set failsafe_landing_time = 2"]


def times(flight):
    """Seconds from the last frame to each of TIMES."""
    try:
        flight.arm(throttle=1500)
        flight.run(0.5)
        last, first = flight.silence(), len(flight.seen)
        flight.run(0.7)
    finally:
        flight.stop()
    conditions = (lambda row: row[1] >> RXLOSS & 1, lambda row: row[3][THROTTLE] < 1000,
                  lambda row: flight.mode(row, BOX_FAILSAFE))
    return [next(row[0] for row in flight.seen[first:] if holds(row)) - last for holds in conditions]


def compare():
    makers = (lambda: Flight(PATH, configuration(4)), lambda: Flight(MUSTER, [], start=Simulation))
    each = [list(zip(*(retried(lambda: times(make())) for _ in range(REPEATS)))) for make in makers]
    for name, real, simulated in zip(TIMES, *each):
        medians = [1000 * statistics.median(values) for values in (real, simulated)]
        claim(abs(medians[1] / medians[0] - 1) <= SHARE,
              f"{name}, median of {REPEATS}: Betaflight {medians[0]:.0f} ms, simulated {medians[1]:.0f} ms")


def lose(delay):
    """A flight in stage 2."""
    flight = Flight(PATH, configuration(delay))
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
compare()
