"""Which settings of the CLI can be read over MSP: each is set to two values, and all replies are compared."""

import time

import firmware
import msp

# Requests that only read, and whose replies hold configuration.
CODES = {"BATTERY_CONFIG": 32, "MODE_RANGES": 34, "FEATURE_CONFIG": 36, "BOARD_ALIGNMENT_CONFIG": 38, "CURRENT_METER_CONFIG": 40,
         "MIXER_CONFIG": 42, "RX_CONFIG": 44, "RSSI_CONFIG": 50, "ADJUSTMENT_RANGES": 52, "CF_SERIAL_CONFIG": 54,
         "VOLTAGE_METER_CONFIG": 56, "PID_CONTROLLER": 59, "ARMING_CONFIG": 61, "RX_MAP": 64, "FAILSAFE_CONFIG": 75,
         "RXFAIL_CONFIG": 77, "BLACKBOX_CONFIG": 80, "ADVANCED_CONFIG": 90, "FILTER_CONFIG": 92, "PID_ADVANCED": 94,
         "SENSOR_CONFIG": 96, "RC_TUNING": 111, "PID": 112, "MOTOR_3D_CONFIG": 124, "RC_DEADBAND": 125, "SENSOR_ALIGNMENT": 126,
         "BATTERY_STATE": 130, "MOTOR_CONFIG": 131, "GPS_CONFIG": 132, "COMPASS_CONFIG": 133, "GPS_RESCUE": 135,
         "BEEPER_CONFIG": 184, "MODE_RANGES_EXTRA": 238}
# Two values of each setting; a line with a space is a command of its own.
SETTINGS = [
    ("msp_override_channels_mask", "0", "15"), ("msp_override_failsafe", "OFF", "ON"),
    ("failsafe_delay", "10", "21"), ("failsafe_landing_time", "20", "61"), ("failsafe_throttle", "1300", "1401"),
    ("failsafe_switch_mode", "STAGE1", "KILL"), ("failsafe_throttle_low_delay", "50", "101"),
    ("failsafe_procedure", "DROP", "AUTO-LAND"), ("failsafe_recovery_delay", "5", "21"), ("failsafe_stick_threshold", "30", "11"),
    ("rxfail 3", "a", "s 1300"), ("rxfail 4", "h", "s 1000"), ("aux 5", "1 2 900 900 0 0", "1 2 1300 1700 0 0"),
    ("map", "AETR1234", "TAER1234"), ("min_check", "1050", "1061"), ("max_check", "1900", "1911"), ("mid_rc", "1500", "1511"),
    ("rx_min_usec", "885", "900"), ("rx_max_usec", "2115", "2100"), ("serial_update_rate_hz", "100", "1000"),
    ("serial UART2", "0 115200 57600 0 115200", "1 230400 57600 0 115200"), ("small_angle", "25", "180"),
    ("auto_disarm_delay", "5", "51"), ("gyro_cal_on_first_arm", "OFF", "ON"), ("runaway_takeoff_prevention", "ON", "OFF"),
    ("motor_pwm_protocol", "PWM", "DISABLED"), ("feature", "MOTOR_STOP", "-MOTOR_STOP"), ("angle_limit", "60", "41"),
    ("rates_type", "ACTUAL", "QUICK"), ("roll_rc_rate", "7", "20"), ("pitch_rc_rate", "7", "20"), ("roll_srate", "67", "80"),
    ("pitch_srate", "67", "80"), ("roll_expo", "0", "10"), ("pitch_expo", "0", "10"), ("roll_rate_limit", "1998", "600"),
    ("pitch_rate_limit", "1998", "600"), ("throttle_limit_type", "OFF", "SCALE"), ("thr_expo", "0", "30"), ("thr_mid", "50", "40"),
    ("thr_hover", "50", "40"),
    ("vbat_max_cell_voltage", "430", "435"), ("vbat_full_cell_voltage", "410", "405"), ("vbat_min_cell_voltage", "330", "345"),
    ("vbat_warning_cell_voltage", "350", "365"), ("vbat_hysteresis", "1", "5"), ("vbat_detect_cell_voltage", "300", "250"),
    ("use_vbat_alerts", "ON", "OFF"), ("vbat_cutoff_percent", "100", "80"), ("vbat_duration_for_warning", "0", "11"),
    ("vbat_duration_for_critical", "0", "11"), ("vbat_scale", "110", "121"), ("force_battery_cell_count", "0", "4"),
    ("bat_capacity", "0", "1500"), ("battery_meter", "NONE", "ADC"), ("current_meter", "VIRTUAL", "NONE")]


def replies(link):
    found = {}
    for name, code in CODES.items():
        reply = link.request(code, timeout=0.5)
        found[name] = reply[1] if reply and reply[0] == ">" else b""
    return found


def ranges(offsets):
    """Neighbouring offsets joined: 3, 4, 7 → 3–4, 7."""
    text, start = [], None
    for at in offsets:
        if at - 1 not in offsets:
            start = at
        if at + 1 not in offsets:
            text.append(str(at) if start == at else f"{start}–{at}")
    return ", ".join(text)


def after(build, command):
    build.cli([command])
    time.sleep(0.2)
    link = msp.Link()
    found = replies(link)
    link.close()
    time.sleep(0.2)
    return found


build = firmware.Firmware(firmware.program(), firmware.lines("safe-sole.txt"))
print("| setting | readable over MSP: message (code), bytes that differ |\n| --- | --- |")
for name, first, second in SETTINGS:
    start = name if " " in name or name in ("map", "feature") else f"set {name} ="
    before, now = after(build, f"{start} {first}"), after(build, f"{start} {second}")
    places = []
    for message, code in CODES.items():
        one, two = before[message], now[message]
        differing = [at for at in range(max(len(one), len(two))) if one[at:at + 1] != two[at:at + 1]]
        if differing:
            places.append(f"{message} ({code}) {ranges(differing)}")
    print(f"| {name} | {'; '.join(places) or 'no: CLI only'} |", flush=True)
build.stop()
