"""Round-trip time of one request at a time, and how many requests the firmware answers in a second."""

import time

import firmware
import msp
from flight import LOW, Flight, summary

PATH = firmware.program()


def round_trips(link, code, count):
    times = []
    for _ in range(count):
        sent = time.monotonic()
        link.request(code)
        times.append(time.monotonic() - sent)
    return times


def answered(link, in_flight, seconds):
    """Replies a second with `in_flight` requests under way."""
    end, replies, last = time.monotonic() + seconds, 0, time.monotonic()
    link.send(msp.frame(msp.ATTITUDE) * in_flight)
    while time.monotonic() < end:
        if link.receive(0.5):
            link.send(msp.frame(msp.ATTITUDE))
            replies, last = replies + 1, time.monotonic()
    while link.receive(0.2):
        pass
    return replies / (last - end + seconds)


print("| receiver | serial_update_rate_hz | request | n | median ms | max ms | replies/s, 1 under way | 8 under way |")
print("| --- | --- | --- | --- | --- | --- | --- | --- |")
for receiver, rate in (("sole", 100), ("sole", 500), ("sole", 1000), ("sole", 2000), ("override", 100), ("override", 1000)):
    flight = Flight(PATH, [*firmware.lines(f"safe-{receiver}.txt"), f"set serial_update_rate_hz = {rate}"],
                    pilot=[*LOW[:6], 1800, 1000] if receiver == "override" else None)
    flight.sending = False
    for name, code in (("ATTITUDE", msp.ATTITUDE), ("BOXNAMES", msp.BOXNAMES)):
        times = summary(round_trips(flight.link, code, 500))
        print(f"| {receiver} | {rate} | {name} | {times} | {answered(flight.link, 1, 3):.0f} | {answered(flight.link, 8, 3):.0f} |", flush=True)
    flight.stop()
