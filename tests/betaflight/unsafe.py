"""Applies each entry of unsafe.toml: does its change survive `save`, and where is it seen over MSP?"""

import sys
import time
import tomllib

import firmware
import msp

PATH = firmware.program()
HERE = firmware.HERE
MESSAGES = {"MODE_RANGES": 34, "FEATURE_CONFIG": 36, "RX_CONFIG": 44, "CF_SERIAL_CONFIG": 54, "ARMING_CONFIG": 61, "RX_MAP": 64,
            "FAILSAFE_CONFIG": 75, "RXFAIL_CONFIG": 77, "BATTERY_CONFIG": 32, "PID_ADVANCED": 94, "RC_TUNING": 111}


def state(configuration):
    """The lines of `dump`, and the replies, after `save` and a start."""
    build = firmware.Firmware(PATH, configuration)
    link = msp.Link()
    replies = {name: link.request(code, timeout=3) for name, code in MESSAGES.items()}
    link.close()
    time.sleep(0.3)
    dump = build.cli(["dump"])[0].splitlines()
    build.stop()
    return {line.strip() for line in dump}, replies


safe = {base: state(firmware.lines(f"safe-{base}.txt")) for base in ("sole", "override")}
missing = [line for base, (dump, _) in safe.items() for line in firmware.lines(f"safe-{base}.txt") if line not in dump]
print(f"lines of the safe configurations that `dump` doesn't show: {missing or 'none'}")
print("| unsafe | in the dump after save | seen over MSP |\n| --- | --- | --- |")
failed = bool(missing)
for entry in tomllib.loads((HERE / "unsafe.toml").read_text())["unsafe"]:
    dump, replies = state([*firmware.lines(f"safe-{entry['base']}.txt"), *entry["cli"]])
    kept = all(line in dump and line not in safe[entry["base"]][0] for line in entry["cli"])
    seen = [name for name, reply in replies.items() if reply != safe[entry["base"]][1][name]]
    failed |= not kept
    print(f"| {entry['name']} | {'yes' if kept else 'NO'} | {', '.join(seen) or 'no: CLI only'} |", flush=True)
sys.exit(failed)
