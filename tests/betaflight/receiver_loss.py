"""Sole receiver: what happens from the last RC frame on. Armed, throttle 1,500, the aircraft held on the ground."""

import statistics

import firmware
from flight import BOX_FAILSAFE, LOW, Flight, summary

PATH = firmware.program()
REPEATS = 5
hung = 0


def motors(flight, since):
    """(seconds after `since`, mean motor command) of each step of the physics."""
    return [(row[0] - since, sum(row[1:5]) / 4) for row in flight.physics.rows(since)]


def lose(flight, observe):
    """Arms, flies, stops sending; what was seen in the `observe` seconds after the last frame."""
    flight.sticks, flight.sending = list(LOW), True
    flight.arm(throttle=1500)
    flight.run(0.5)
    last, first = flight.silence(), len(flight.seen)
    flight.run(observe)
    rows = [(row[0] - last, row) for row in flight.seen[first:]]
    when = lambda condition: next((at for at, row in rows if condition(row)), None)
    trace = motors(flight, last)
    before = trace[0][1]
    changed = next((at for at, value in trace if abs(value - before) > 0.02), None)
    stage_1 = [value for at, value in trace if 0.5 < at < 0.9]
    return {"lost": when(lambda row: row[1] >> 2 & 1), "stage 2": when(lambda row: flight.mode(row, BOX_FAILSAFE)),
            "disarmed": when(lambda row: not flight.armed(row)), "changed": changed, "before": before,
            "after": statistics.mean(stage_1) if stage_1 else None, "end": trace[-1][1],
            "landing": next((value for at, value in trace if at > observe - 1.5), None)}


def series(configuration, observe):
    """`REPEATS` losses; a flight whose firmware stops answering is done again."""
    global hung
    results, flight = [], None
    while len(results) < REPEATS:
        try:
            flight = flight or Flight(PATH, [*firmware.lines("safe-sole.txt"), "set serial_update_rate_hz = 1000", *configuration])
            results.append(lose(flight, observe))
        except (ConnectionError, RuntimeError):
            hung += 1
            flight.stop()
            flight = None
    flight.stop()
    return results


def column(results, key):
    """Least, median and greatest, in ms."""
    values = [result[key] for result in results if result[key] is not None]
    if not values:
        return "not in time"
    span = " / ".join(f"{1000 * each:.0f}" for each in (min(values), statistics.median(values), max(values)))
    return span + ("" if len(values) == len(results) else f" (in {len(values)} of {len(results)})")


def mean(results, key):
    values = [result[key] for result in results if result[key] is not None]
    return f"{statistics.mean(values):.3f}" if values else "-"


print(f"## Stage 1: failsafe_delay = 20, DROP, n = {REPEATS} each; least / median / greatest ms after the last frame")
print("| rxfail of throttle | RXLOSS flag | motors change | mean motor before | 0.5–0.9 s after |\n| --- | --- | --- | --- | --- |")
for rxfail in ("rxfail 3 a", "rxfail 3 h", "rxfail 3 s 1300"):
    seen = series([rxfail, "set failsafe_delay = 20", "set failsafe_procedure = DROP"], 1.5)
    print(f"| `{rxfail}` | {column(seen, 'lost')} | {column(seen, 'changed')} | {mean(seen, 'before')} | {mean(seen, 'after')} |", flush=True)

print(f"\n## Stage 2: n = {REPEATS} each; least / median / greatest ms after the last frame; failsafe_throttle = 1400, failsafe_landing_time = 2")
print("| procedure | failsafe_delay | RXLOSS flag | stage 2 (FAILSAFE mode) | disarmed | mean motor in stage 2 | at the end |")
print("| --- | --- | --- | --- | --- | --- | --- |")
for procedure in ("DROP", "AUTO-LAND"):
    for delay in (2, 4, 10):
        observe = delay / 10 + (1.2 if procedure == "DROP" else 3.2)
        seen = series([f"set failsafe_delay = {delay}", f"set failsafe_procedure = {procedure}", "set failsafe_landing_time = 2",
                       "set failsafe_throttle = 1400"], observe)
        print(f"| {procedure} | {delay} | {column(seen, 'lost')} | {column(seen, 'stage 2')} | {column(seen, 'disarmed')} | "
              f"{mean(seen, 'landing') if procedure == 'AUTO-LAND' else '-'} | {mean(seen, 'end')} |", flush=True)

print(f"\n## Throttle low for longer than failsafe_throttle_low_delay (1 s), AUTO-LAND, failsafe_delay = 10, n = {REPEATS}")
flight = Flight(PATH, [*firmware.lines("safe-sole.txt"), "set serial_update_rate_hz = 1000", "set failsafe_throttle_low_delay = 10",
                       "set failsafe_delay = 10"])
disarmed = []
for _ in range(REPEATS):
    flight.sticks, flight.sending = list(LOW), True
    flight.arm()
    flight.run(2)
    last = flight.silence()
    disarmed.append(flight.wait(lambda row: not flight.armed(row), 5) - last)
flight.stop()
print(f"disarmed after n | median | max ms: {summary(disarmed)}")
print(f"flights done again because the firmware stopped answering: {hung}")
