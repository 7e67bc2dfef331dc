"""`muster fc simulate` over a pseudo-terminal beside an independent client, yamspy (`.ci/betaflight`): the client reads who it is,
attitude, battery, GPS and RC, and sets RC. Exits with 1 if a value is not what the simulation has. Argument: MUSTER."""

import os
import struct
import subprocess
import sys
import tempfile
import time

from yamspy import MSPy

MUSTER = os.path.abspath(sys.argv[1])
RC = [1510, 1490, 1000, 1520, 1000, 1800]  # roll, pitch, throttle, yaw, AUX1, AUX2
# The client has its own order for MSP_RC: roll, pitch, yaw, throttle.
READ = [1510, 1490, 1520, 1000, 1000, 1800]


def ask(board, name, data=b""):
    assert board.send_RAW_msg(MSPy.MSPCodes[name], data), name
    board.process_recv_data(board.receive_msg())


def look(link):
    with MSPy(device=link, loglevel="ERROR", logfilename=None) as board:
        assert board != 1, "no connection"
        for _ in range(25):
            ask(board, "MSP_SET_RAW_RC", struct.pack("<6H", *RC))
            time.sleep(0.02)
        board.SENSOR_DATA["kinematics"] = [99.0, 99.0, 999.0]  # which no answer gives
        for name in ("MSP_RC", "MSP_ATTITUDE", "MSP_ANALOG", "MSP_RAW_GPS", "MSP_STATUS"):
            ask(board, name)
        return {
            "variant": board.CONFIG["flightControllerIdentifier"],
            "version": board.CONFIG["flightControllerVersion"],
            "channels": board.RC["channels"][:6],
            "roll_pitch_yaw_deg": board.SENSOR_DATA["kinematics"],
            "volts": board.ANALOG["voltage"],
            "satellites": board.GPS_DATA["numSat"],
        }


with tempfile.TemporaryDirectory() as folder:
    os.chdir(folder)  # the client writes a log where it is
    link = os.path.join(folder, "controller")
    simulation = subprocess.Popen([MUSTER, "fc", "simulate", "--pty", link], stdout=subprocess.PIPE, text=True)
    try:
        print(simulation.stdout.readline().strip())
        seen = look(link)
    finally:
        simulation.kill()
print("the client read:", seen)
assert (seen["variant"], seen["version"]) == ("BTFL", "4.6.0")
assert seen["channels"] == READ
roll, pitch, yaw = seen["roll_pitch_yaw_deg"]
assert abs(roll) < 2 and abs(pitch) < 2 and 0 <= yaw < 360
assert 16.0 < seen["volts"] < 16.9
assert seen["satellites"] == 14
print("all as expected")
