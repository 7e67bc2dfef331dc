"""What BATTERY_STATE says with each voltage meter, armed at half throttle. This build has no voltage sensor to sag."""

import struct

import firmware
import msp
from flight import Flight

PATH = firmware.program()
STATES = "OK WARNING CRITICAL NOT_PRESENT INIT".split()

print("| configuration | cells | capacity mAh | 0.1 V | mAh | 0.01 A | state | 0.01 V | bytes |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
for configuration in ([], ["set battery_meter = ADC", "set bat_capacity = 1500"],
                      ["set battery_meter = ADC", "set vbat_detect_cell_voltage = 0", "set force_battery_cell_count = 4"],
                      ["set battery_meter = ESC"],
                      ["set current_meter = VIRTUAL", "set ibatv_scale = 1000", "set ibatv_offset = 50"]):
    flight = Flight(PATH, [*firmware.lines("safe-sole.txt"), *configuration])
    flight.arm(throttle=1500)
    flight.run(5)
    payload = flight.ask(msp.BATTERY_STATE)
    cells, capacity, decivolts, drawn, current, state, centivolts = struct.unpack_from("<BHBHhBH", payload)
    print(f"| {'; '.join(configuration) or 'defaults'} | {cells} | {capacity} | {decivolts} | {drawn} | {current} | "
          f"{STATES[state]} ({state}) | {centivolts} | {len(payload)} |", flush=True)
    flight.stop()
