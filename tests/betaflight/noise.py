"""What the firmware's parser makes of bad bytes. After each, ATTITUDE requests every 50 ms: how many go unanswered?"""

import struct
import time

import firmware
import msp
from flight import Flight, flag_names

PATH = firmware.program()


def spoiled(frame):
    return frame[:-1] + bytes([frame[-1] ^ 0xFF])


ATTITUDE = msp.frame(msp.ATTITUDE)
CASES = [
    ("nothing", b""),
    ("bad checksum (v1)", spoiled(ATTITUDE)),
    ("bad checksum (v2)", spoiled(msp.frame_v2(msp.ATTITUDE))),
    ("v1 payload of 192 bytes, unknown code", msp.frame(249, bytes(192))),
    ("v1 payload of 193 bytes", msp.frame(249, bytes(193))),
    ("v1 payload of 193 bytes of $", msp.frame(249, b"$" * 193)),
    ("v2 payload of 192 bytes, unknown code", msp.frame_v2(0x4FFF, bytes(192))),
    ("v2 size 193 stated, 10 bytes follow", b"$X<" + struct.pack("<BHH", 0, 0x4FFF, 193) + bytes(10)),
    ("v1 size 100 stated in noise: `$M<`, 100, code", b"$M<\x64\x6c"),
    ("v1 size 20 stated in noise", b"$M<\x14\x6c"),
    ("`$` alone", b"$"),
    ("`$M` alone", b"$M"),
    ("`$M<` alone", b"$M<"),
    ("100 bytes of 0xFF", b"\xff" * 100),
    ("a reply (`$M>`) instead of a request", b"$M>" + ATTITUDE[3:]),
    ("an error frame (`$M!`)", b"$M!" + ATTITUDE[3:]),
    ("unknown code 121", msp.frame(121)),
    ("SET_RAW_RC of 19 channels", msp.frame(msp.SET_RAW_RC, bytes(38))),
    ("SET_RAW_RC of 3 bytes", msp.frame(msp.SET_RAW_RC, b"\xdc\x05\xdc")),
]


def probe(link, count=20):
    """Which of `count` requests are unanswered (first is 1), and which other replies came."""
    missing, others = [], []
    for number in range(1, count + 1):
        link.send(ATTITUDE)
        deadline, answered = time.monotonic() + 0.2, False
        while not answered and (reply := link.receive(deadline - time.monotonic())):
            answered = reply[1] == msp.ATTITUDE
            if not answered:
                others.append(f"{reply[0]}{reply[1]}")
        if not answered:
            missing.append(number)
    return missing, others


def fresh():
    flight = Flight(PATH, [*firmware.lines("safe-sole.txt"), "set serial_update_rate_hz = 1000"])
    flight.silence()
    while flight.link.read(0.5):
        flight.link.buffer.clear()
    return flight


flight = fresh()
print("| bytes, then 20 ATTITUDE requests | unanswered | other replies |\n| --- | --- | --- |")
for name, data in CASES:
    if data:
        flight.link.send(data)
        time.sleep(0.1)
    missing, others = probe(flight.link)
    print(f"| {name} | {'none' if not missing else f'{len(missing)}: first {missing[0]}, last {missing[-1]}'} | {' '.join(others) or 'none'} |", flush=True)
    if missing and missing[-1] == 20:
        flight.stop()
        flight = fresh()

flight.stop()
print("\n## A stray `#`")


def stray(armed, after):
    flight = Flight(PATH, [*firmware.lines("safe-sole.txt"), "set serial_update_rate_hz = 1000"])
    flight.wait(lambda row: row[1] == 0, 12)
    if armed:
        flight.arm(throttle=1200)
        flight.run(0.5)
    flight.silence()
    time.sleep(0.1)
    flight.link.buffer.clear()
    flight.link.send(b"#" + after)
    if not after:
        time.sleep(0.3)
    answered, raw = flight.link.request(msp.STATUS, timeout=0.5) if not after else None, b""
    while flight.link.read(0.3):
        pass
    raw = bytes(flight.link.buffer)
    last = flight.physics.last()["front_right"]
    print(f"- {'armed' if armed else 'disarmed'}, `#` then {'a request at once' if after else '300 ms of silence, then STATUS'}: "
          f"{'answered' if answered or after and raw.startswith(b'$M>') else 'no MSP reply'}; {len(raw)} bytes came: {raw[:60]!r}; motor {last:.2f}")
    flight.link.close()
    time.sleep(0.5)
    flight.link = msp.Link()
    reply = flight.link.request(msp.STATUS, timeout=1)
    print(f"  a new connection: {'STATUS answered, flags ' + str(flag_names(struct.unpack_from('<I', reply[1], 17 + reply[1][15])[0])) if reply else 'no MSP reply, the CLI stays'}")
    flight.stop()


stray(False, b"")
stray(False, ATTITUDE)
stray(True, b"")
