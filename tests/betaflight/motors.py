"""SET_MOTOR: disarmed, armed, without a client, after the link is closed."""

import struct
import time

import firmware
import msp
from flight import Flight

PATH = firmware.program()


def outputs(flight):
    """Front right, rear left, front left, rear right, as the physics sees them: 0 to 1."""
    last = flight.physics.last()
    return [round(last[name], 2) for name in ("front_right", "rear_left", "front_left", "rear_right")]


def reported(flight):
    return struct.unpack("<8H", flight.ask(msp.MOTOR))[:4]


def set_motors(flight, *values):
    flight.link.request(msp.SET_MOTOR, msp.channels_payload(list(values)))


flight = Flight(PATH, firmware.lines("safe-sole.txt"))
flight.wait(lambda row: row[1] == 0, 12)
print(f"at rest: outputs {outputs(flight)}, MSP_MOTOR {reported(flight)}")
set_motors(flight, 1100, 1200, 1300, 1400)
flight.run(0.5)
print(f"disarmed, SET_MOTOR 1100 1200 1300 1400: outputs {outputs(flight)}, MSP_MOTOR {reported(flight)} (motor 1 is rear right)")
flight.run(10)
print(f"10 s later, RC frames but no SET_MOTOR: outputs {outputs(flight)}")
flight.silence()
flight.run(5)
print(f"5 s after the last RC frame: outputs {outputs(flight)}, flags {flight.seen[-1][1]}")
flight.link.close()
time.sleep(10)
print(f"10 s after the connection was closed: outputs {outputs(flight)}")
flight.link, flight.sending = msp.Link(), True
flight.run(1)
print(f"connected again: outputs {outputs(flight)}")
flight.arm(throttle=1000)
flight.run(0.5)
print(f"then armed, throttle 1,000: outputs {outputs(flight)}")
set_motors(flight, 1900, 1900, 1900, 1900)
flight.run(0.5)
print(f"armed, SET_MOTOR 1900: outputs {outputs(flight)}")
flight.sticks[4] = 1000
flight.run(0.5)
print(f"disarmed again: outputs {outputs(flight)}, MSP_MOTOR {reported(flight)}")
set_motors(flight, 1000, 1000, 1000, 1000)
flight.run(0.5)
print(f"SET_MOTOR 1000: outputs {outputs(flight)}")
set_motors(flight, 1500)
flight.run(0.5)
print(f"SET_MOTOR with one motor, 1500: outputs {outputs(flight)}, MSP_MOTOR {reported(flight)}")
set_motors(flight, 0, 0, 0, 0)
flight.run(0.5)
print(f"SET_MOTOR 0: outputs {outputs(flight)}, MSP_MOTOR {reported(flight)}")
flight.stop()
