"""`muster fc` beside the real firmware: arguments PROGRAM (printed by .ci/betaflight) and MUSTER.

A safe configuration breaks no rule; each change of unsafe.toml and of UNSAFE breaks one; what `check` says to set mends the
defaults; `probe` and `watch` show what the command line, the physics and another client say."""

import json
import math
import os
import re
import struct
import subprocess
import sys
import time
import tomllib

import firmware
import msp
import physics

PATH = firmware.program()
MUSTER = os.path.abspath(sys.argv[2])
DEVICE = "tcp:127.0.0.1:5761"
# Betaflight 4.6 can't mend it.
UNMENDABLE = {"override-fallback"}
# Further changes: base, lines, rule.
UNSAFE = [
    ("sole", ["set failsafe_procedure = DROP"], "failsafe-procedure"),
    ("sole", ["set failsafe_throttle_low_delay = 5"], "failsafe-throttle-low-delay"),
    ("sole", ["set failsafe_landing_time = 3"], "failsafe-landing-time"),
    ("sole", ["rxfail 1 h"], "rxfail-stick"),
    ("sole", ["rxfail 4 s 1000"], "rxfail-arm"),
    ("sole", ["aux 0 0 0 900 900 0 0"], "arm-mode"),
    ("sole", ["set small_angle = 180"], "small-angle"),
    ("sole", ["set min_check = 1300"], "min_check"),
    ("sole", ["set rx_min_usec = 1010"], "rx_min_usec"),
    ("sole", ["set motor_pwm_protocol = DISABLED"], "motor-protocol"),
    ("sole", ["feature MOTOR_STOP"], "motor-stop"),
    ("sole", ["set vbat_min_cell_voltage = 250"], "battery-min"),
    ("sole", ["set vbat_warning_cell_voltage = 330"], "battery-warning"),
    ("sole", ["set mid_rc = 1450"], "mid_rc"),
    ("sole", ["set rates_type = KISS"], "rates"),
    ("sole", ["set pitch_rc_rate = 20"], "rates"),
    ("sole", ["set roll_srate = 30"], "rates"),
    ("sole", ["set roll_expo = 54"], "rates"),
    ("sole", ["set pitch_rate_limit = 400"], "rates"),
    ("sole", ["set angle_limit = 45"], "angle_limit"),
    ("sole", ["set throttle_limit_type = SCALE"], "throttle-curve"),
    ("sole", ["set thr_hover = 30"], "throttle-curve"),
    ("override", ["set angle_feedforward = 50"], "angle-feedforward"),
    ("override", ["set rates_type = QUICK"], "rates"),
    ("override", ["set msp_override_channels_mask = 7"], "override-mask"),
    ("override", ["aux 2 50 2 900 900 0 0"], "override-mode"),
    ("override", ["aux 2 50 2 1700 1900 0 0"], "override-range"),
    ("override", ["aux 2 50 0 1700 2100 0 0"], "override-switch"),
    ("override", ["aux 3 1 3 1700 2100 1 0"], "mode-link"),
    ("override", ["aux 3 50 3 900 900 0 1"], "mode-link"),
    ("override", ["aux 3 6 3 900 2100 0 0"], "other-mode"),
]


def muster(*arguments):
    run = subprocess.run([MUSTER, "fc", *arguments], capture_output=True, text=True, timeout=60)
    return run.returncode, run.stdout, run.stderr


def check(base):
    """The findings, by rule."""
    options = ["--receiver", base] + (["--cli"] if base == "override" else [])
    code, out, error = muster("check", DEVICE, "--json", *options)
    assert code in (0, 5), error
    findings = {it["rule"]: it for it in json.loads(out)["findings"]}
    assert (code == 5) == bool(findings)
    return findings


def started(configuration):
    """A firmware that answers: now and then it listens and says nothing, to no client."""
    build = firmware.Firmware(PATH, configuration)
    for _ in range(4):
        link = msp.Link()
        answer = link.request(msp.API_VERSION, timeout=3)
        link.close()
        time.sleep(0.3)
        if answer:
            return build
        build.start()
    raise RuntimeError("the firmware doesn't answer")


def findings_of(configuration, base):
    build = started(configuration)
    try:
        return check(base)
    finally:
        build.stop()


def fail(text):
    print(f"FAILED: {text}")
    sys.exit(1)


for base, expected in ("sole", set()), ("override", UNMENDABLE):
    found = findings_of(firmware.lines(f"safe-{base}.txt"), base)
    print(f"safe-{base}.txt: {sorted(found) or 'fit'}", flush=True)
    if set(found) != expected:
        fail(found)

changes = [(it["base"], it["cli"], it["rule"]) for it in tomllib.loads((firmware.HERE / "unsafe.toml").read_text())["unsafe"]]
for base, lines, rule in changes + UNSAFE:
    found = findings_of([*firmware.lines(f"safe-{base}.txt"), *lines], base)
    new = set(found) - UNMENDABLE
    print(f"{' '.join(lines)}: {sorted(new)}", flush=True)
    if new != {rule}:
        fail(f"{lines}: {found}")

for base in "sole", "override":
    mended = ["set motor_pwm_protocol = PWM"]
    for _ in range(3):
        found = findings_of(mended, base)
        new = [it["set"] for rule, it in found.items() if rule not in UNMENDABLE]
        mended += [line for it in new for line in it.splitlines()]
        if not new:
            break
    print(f"defaults, {base}, mended by: {mended}; left: {sorted(found)}", flush=True)
    if set(found) - UNMENDABLE:
        fail(found)

TILT_DEG = 12
peer = physics.Peer(held=True, tilt=math.radians(TILT_DEG))
build = started([*firmware.lines("safe-sole.txt"), "set craft_name = muster"])
code, out, error = muster("probe", DEVICE, "--json")
assert code == 0, error
seen = json.loads(out)
print("probe:", seen)
assert (seen["variant"], seen["version"], seen["board"], seen["name"]) == ("BTFL", "4.6.0", "SITL", "muster")
assert seen["map"] == "AETR1234" and seen["armed"] is False and seen["line"]["loss"] == 0


def command_line():
    """What the command line's `status` shows: volts, the battery's state, reasons not to arm but those of looking at it."""
    status = "".join(build.cli(["status"]))
    print(status)
    volts, battery = re.search(r"Voltage: (\d+) \* 0\.01V \(\d+S battery - ([A-Z ]+)\)", status).groups()
    arming = re.search(r"Arming disable flags: *(.*)", status).group(1).split()
    return int(volts) / 100, battery, set(arming) - {"CLI", "BOOTGRACE", "CALIB", "ARM_SWITCH"}


volts, battery, arming = command_line()
assert arming <= set(seen["arming_disabled"]), (arming, seen["arming_disabled"])
time.sleep(0.5)
code, out, error = muster("watch", DEVICE, "--json", "--seconds", "4")
assert code == 0, error
rows = [json.loads(line) for line in out.splitlines()]
last = rows[-1]
print("watch:", last)
assert len(rows) == 4 and last["state"] == "open" and last["loss"] == 0
assert last["frames_per_second"] > 20
assert last["voltage_v"] == volts and last["battery"].upper() == battery, (last, volts, battery)
assert arming <= set(last["arming_disabled"]), (arming, last["arming_disabled"])
assert abs(last["roll_deg"] - TILT_DEG) < 0.5 and abs(last["pitch_deg"]) < 0.5, last
link = msp.Link()
channels = struct.unpack("<18H", link.request(msp.RC)[1])
link.close()
rc = last["rc_us"]
assert [rc[name] for name in ("roll", "pitch", "yaw", "throttle")] + rc["aux"] == list(channels), (rc, channels)
build.stop()
print("all as expected")
