"""Talks to the simulated controller over a serial line by an independent client: reads who it is, attitude, battery, RC; sets RC.

usage: simulated.py DEVICE
Needs yamspy (`.ci/betaflight`). Its last line is what it read, as a JSON object.
"""

import json
import struct
import sys
import time

from yamspy import MSPy

RC = [1510, 1490, 1000, 1520, 1000, 1800]  # roll, pitch, throttle, yaw, AUX1, AUX2


def ask(board, name, data=b""):
    assert board.send_RAW_msg(MSPy.MSPCodes[name], data), name
    board.process_recv_data(board.receive_msg())


with MSPy(device=sys.argv[1], loglevel="ERROR", logfilename=None) as board:
    assert board != 1, "no connection"
    for _ in range(25):
        ask(board, "MSP_SET_RAW_RC", struct.pack("<6H", *RC))
        time.sleep(0.02)
    for name in ("MSP_RC", "MSP_ATTITUDE", "MSP_ANALOG", "MSP_RAW_GPS", "MSP_STATUS"):
        ask(board, name)
    print(json.dumps({
        "variant": board.CONFIG["flightControllerIdentifier"],
        "version": board.CONFIG["flightControllerVersion"],
        "api": board.CONFIG["apiVersion"],
        "channels": board.RC["channels"][:6],
        "roll_pitch_yaw_deg": board.SENSOR_DATA["kinematics"],
        "volts": board.ANALOG["voltage"],
        "satellites": board.GPS_DATA["numSat"],
    }))
