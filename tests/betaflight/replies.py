"""Records one reply of each message into a TOML file: the bytes, what yamspy decodes, what the CLI's `dump all` says.

usage: replies.py PROGRAM FILE, with the Python of .ci/betaflight's folder.
"""

import json
import pathlib
import sys
import time

import decode
import firmware
import msp
from flight import Flight

CONFIGURATION = [
    "set craft_name = muster", "set bat_capacity = 1500", "set vbat_min_cell_voltage = 340", "set vbat_warning_cell_voltage = 360",
    "set failsafe_landing_time = 20", "set failsafe_throttle_low_delay = 50", "set failsafe_switch_mode = KILL",
    "set min_check = 1040", "set max_check = 1910", "set mid_rc = 1502", "set rx_min_usec = 900", "set rx_max_usec = 2100",
    "rxfail 3 s 1300", "rxfail 5 s 1000", "aux 3 27 4 1300 1700 0 0", "set auto_disarm_delay = 7", "feature MOTOR_STOP",
    "set msp_override_channels_mask = 47", "aux 2 50 2 1700 2100 0 0",
    "set rates_type = QUICK", "set roll_rc_rate = 71", "set pitch_rc_rate = 72", "set yaw_rc_rate = 73", "set roll_expo = 11",
    "set pitch_expo = 12", "set yaw_expo = 13", "set roll_srate = 61", "set pitch_srate = 62", "set yaw_srate = 63",
    "set roll_rate_limit = 1001", "set pitch_rate_limit = 1002", "set yaw_rate_limit = 1003", "set throttle_limit_type = CLIP",
    "set throttle_limit_percent = 98", "set thr_mid = 51", "set thr_hover = 52", "set thr_expo = 3", "set angle_limit = 41"]
# Message: what starts the lines of `dump all` that say the same.
MESSAGES = {
    "API_VERSION": [], "FC_VARIANT": ["# Betaflight"], "FC_VERSION": ["# Betaflight"],
    "BOARD_INFO": ["# Betaflight", "board_name", "manufacturer_id"], "BUILD_INFO": ["# Betaflight"],
    "NAME": ["set craft_name"],
    "BATTERY_CONFIG": ["set vbat_min_cell", "set vbat_max_cell", "set vbat_warning_cell", "set bat_capacity", "set battery_meter",
                       "set current_meter"],
    "MODE_RANGES": ["aux "], "FEATURE_CONFIG": ["feature "],
    "RX_CONFIG": ["set serialrx_provider", "set max_check", "set mid_rc", "set min_check", "set spektrum_sat_bind", "set rx_min_usec",
                  "set rx_max_usec", "set airmode_start_throttle", "set fpv_mix_degrees", "set rc_smoothing"],
    "CF_SERIAL_CONFIG": ["serial "], "SONAR": [], "ARMING_CONFIG": ["set auto_disarm_delay", "set small_angle", "set gyro_cal_on_first_arm"],
    "RX_MAP": ["map "], "FAILSAFE_CONFIG": ["set failsafe_"], "RXFAIL_CONFIG": ["rxfail "],
    "RC_TUNING": ["set rates_type", "set roll_rc_rate", "set pitch_rc_rate", "set yaw_rc_rate", "set roll_expo", "set pitch_expo",
                  "set yaw_expo", "set roll_srate", "set pitch_srate", "set yaw_srate", "set roll_rate_limit",
                  "set pitch_rate_limit", "set yaw_rate_limit", "set thr_mid", "set thr_expo", "set thr_hover",
                  "set throttle_limit"],
    "PID_ADVANCED": ["set angle_limit"],
    "STATUS": [], "RAW_IMU": [], "MOTOR": [], "RC": [], "RAW_GPS": [], "ATTITUDE": [], "ALTITUDE": [], "ANALOG": [],
    "BOXNAMES": [], "BOXIDS": [], "BATTERY_STATE": [], "STATUS_EX": [], "UID": []}

# MULTIPLE_MSP asks for BOXNAMES, MODE_RANGES and RX_CONFIG at once: its reply is a jumbo frame.
OTHERS = [("v1", "SET_RAW_RC", msp.frame(msp.SET_RAW_RC, msp.channels_payload([1500, 1500, 1000, 1500, 1000]))),
          ("v1", "SET_MOTOR", msp.frame(msp.SET_MOTOR, msp.channels_payload([1000] * 4))),
          ("v1 jumbo", "MULTIPLE_MSP", msp.frame(230, bytes((msp.BOXNAMES, msp.MODE_RANGES, msp.RX_CONFIG)))),
          ("v1", "unknown 121", msp.frame(121)), ("v2", "unknown 0x4FFF", msp.frame_v2(0x4FFF)),
          ("v2", "SENSOR_RANGEFINDER 0x1F01", msp.frame_v2(0x1F01, b"\xff\xe8\x03\x00\x00"))]


def raw(link, request):
    """The bytes of the reply."""
    link.chunks = []
    link.send(request)
    deadline = time.monotonic() + 0.3
    while time.monotonic() < deadline:
        link.read(0.1)
    link.buffer.clear()
    return b"".join(link.chunks)


def first_profile(lines):
    """Without the settings of further profiles; the first one is active."""
    first = {}
    for line in lines:
        first.setdefault(line.split(" = ")[0], line)
    return list(first.values())


def entry(kind, name, request, reply, cli):
    decoded = decoder.decode(reply)[1] if kind != "v2 over v1" else None
    text = [f'[[reply]]\nname = "{name}"\nframing = "{kind}"\nrequest = "{request.hex()}"\nreply = "{reply.hex()}"']
    if decoded is not None:
        text.append(f"yamspy = '{json.dumps(decoded)}'")
    if cli:
        text.append("cli = [\n" + "".join(f"  '{line}',\n" for line in cli) + "]")
    return "\n".join(text) + "\n"


EMPTY = "reply = \"\""
path, file = firmware.program(), pathlib.Path(sys.argv[2])
flight = Flight(path, [*firmware.lines("safe-sole.txt"), *CONFIGURATION])
flight.run(6)
flight.sending = False
flight.link.close()
time.sleep(0.3)
dump = [line.strip() for line in flight.firmware.cli(["dump all"])[0].splitlines()]
time.sleep(0.3)
link, decoder, entries = msp.Link(), decode.Decoder(), []
for name, starts in MESSAGES.items():
    code, cli = getattr(msp, name), first_profile(line for line in dump if starts and line.startswith(tuple(starts)))
    request = msp.frame(code)
    entries.append(entry("v1", name, request, raw(link, request), cli))
for kind, name, request in OTHERS:
    entries.append(entry(kind, name, request, raw(link, request), []))
for name in ("ATTITUDE", "STATUS", "BOXNAMES"):
    code = getattr(msp, name)
    entries.append(entry("v2", name, msp.frame_v2(code), raw(link, msp.frame_v2(code)), []))
    over = msp.frame(255, msp.frame_v2(code)[3:])
    entries.append(entry("v2 over v1", name, over, raw(link, over), []))
flight.stop()
head = ("# One reply of each message, as Betaflight 4.6.0's simulation build sent it; see README.md. `yamspy` holds JSON.\n\n")
file.write_text(head + "\n".join(entries))
print(f"{len(entries)} replies, {file.stat().st_size} bytes; unanswered: "
      f"{[text.splitlines()[1] for text in entries if EMPTY in text]}")
