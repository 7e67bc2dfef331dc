"""Records a flight of 10,000 frames into a folder: disarmed, armed, flying by MSP sticks, receiver lost, link back.

usage: record.py PROGRAM FOLDER, with the Python of .ci/betaflight's folder.
"""

import json
import math
import pathlib
import random
import sys
import time

import decode
import firmware
import msp
from flight import Flight, flag_names

FRAMES = 10_000
OFTEN = [msp.ATTITUDE, msp.STATUS_EX, msp.RC, msp.ATTITUDE, msp.MOTOR, msp.RAW_IMU, msp.ATTITUDE, msp.ANALOG, msp.ALTITUDE,
         msp.STATUS, msp.BATTERY_STATE]
ONCE = [msp.API_VERSION, msp.FC_VARIANT, msp.FC_VERSION, msp.BOARD_INFO, msp.BUILD_INFO, msp.NAME, msp.BOXIDS, msp.BOXNAMES,
        msp.MODE_RANGES, msp.RX_MAP, msp.RX_CONFIG, msp.FAILSAFE_CONFIG, msp.RXFAIL_CONFIG, msp.BATTERY_CONFIG,
        msp.FEATURE_CONFIG, msp.CF_SERIAL_CONFIG, msp.UID, msp.SONAR, msp.RAW_GPS, 121]
# From which frame on: what happens.
ARM, CLIMB, MOVE, LOSE, BACK = 900, 1000, 1150, 3300, 4000
IN_FLIGHT_MAX = 4

path, folder = firmware.program(), pathlib.Path(sys.argv[2])
flight = Flight(path, [*firmware.lines("safe-sole.txt"), "set serial_update_rate_hz = 1000", "set ibatv_scale = 300",
                                "set craft_name = recorded"], held=False)
sizes = random.Random(24)
received, lengths, sent, frames, replies = bytearray(), [], bytearray(), 0, []
start, next_sticks, next_poll, polls = time.monotonic(), 0.0, 0.0, 0


def send(frame):
    global frames
    flight.link.send(frame)
    sent.extend(frame)
    frames += 1


def read(timeout=0.0005):
    while flight.link.read(timeout):
        while taken := msp.take_frame(flight.link.buffer):
            replies.append(taken)


def sticks(at):
    """Roll, pitch, throttle, yaw, AUX1 and AUX2 of the moment."""
    body = flight.physics.last()
    throttle = 1000
    if CLIMB < frames < LOSE:
        throttle = max(1100, min(1700, 1440 + 60 * (3 + body["z"]) + 50 * body["vz"]))
    wave = (lambda period: 150 * math.sin(2 * math.pi * at / period)) if MOVE < frames < LOSE else (lambda _: 0)
    armed = 1800 if ARM < frames < BACK else 1000
    return [int(1500 + wave(3.1)), int(1500 + wave(4.3)), int(throttle), int(1500 + wave(5.9)), armed, 1500, 1000, 1000 + polls % 1000]


flight.sending = False
while flight.link.read(0.3):
    flight.link.buffer.clear()
flight.link.chunks = chunks = []
receive = flight.link.socket.recv
flight.link.socket = type("Socket", (), {  # the same socket, read in pieces
    "recv": lambda _, __: receive(sizes.choice((5, 17, 64, 4096))), "fileno": lambda _, s=flight.link.socket: s.fileno(),
    "sendall": lambda _, data, s=flight.link.socket: s.sendall(data), "close": lambda _, s=flight.link.socket: s.close()})()
while frames * 2 < FRAMES:
    at = time.monotonic() - start
    if at >= next_sticks:
        next_sticks = at + 0.02
        if not LOSE < frames < BACK:
            send(msp.frame(msp.SET_RAW_RC, msp.channels_payload(sticks(at))))
    if at >= next_poll and frames - len(replies) < IN_FLIGHT_MAX and frames * 2 < FRAMES:
        next_poll = at + 0.0125
        code = ONCE[polls // 40 % len(ONCE)] if polls % 40 == 0 else OFTEN[polls % len(OFTEN)]
        send((msp.frame_v2 if polls % 10 == 3 else msp.frame)(code))
        polls += 1
    read()
read(timeout=2)
flight.stop()

for chunk in chunks:
    received += chunk
    lengths.append(len(chunk))
assert len(replies) == frames, f"{frames} requests, {len(replies)} replies"
decoder = decode.Decoder()
decoded = [[code or "error", *(values or [])] for code, values in map(decoder.decode, replies)]

folder.mkdir(parents=True, exist_ok=True)
(folder / "session-sent.bin").write_bytes(sent)
(folder / "session-received.bin").write_bytes(received)
(folder / "session-reads.txt").write_text("".join(f"{length}\n" for length in lengths))
(folder / "session-decoded.jsonl").write_text("".join(json.dumps(r, separators=(",", ":")) + "\n" for r in decoded))
flags = {reply[-1] for reply in decoded if reply[0] == msp.STATUS_EX}
print(f"{frames} requests, {len(decoded)} replies in {time.monotonic() - start:.0f} s, {len(lengths)} reads, arming flags seen: {sorted(map(flag_names, flags))}")
