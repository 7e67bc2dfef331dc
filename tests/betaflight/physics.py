"""A quadrotor of 0.65 kg as a rigid body, in the loop with the firmware: state to UDP 9003, motors from UDP 9002.

Axes: earth north-east-down, body forward-right-down. Units: metres, seconds, radians, kilograms, newtons.
The firmware wants velocity east-north-up and longitude, latitude, altitude for a virtual GPS, and a constant timestamp.
"""

import math
import multiprocessing
import signal
import socket
import struct
import time

GRAVITY = 9.80665
MASS = 0.65
INERTIA = 0.0028, 0.0028, 0.0045
ARM = 0.08           # lateral and longitudinal distance of each motor from the centre
THRUST_MAX = 8.0     # of one motor; thrust = THRUST_MAX · speed²
MOTOR_LAG = 0.02     # time constant of the motor's speed, first order
YAW_TORQUE = 0.018   # torque about the axis for each newton of thrust
DRAG = 0.25          # N for each m/s, linear
RATE_DRAG = 0.002    # N·m for each rad/s
STEP = 0.001
LATITUDE, LONGITUDE, METRES_PER_DEGREE = 39.48, -0.34, 111_320.0
COLUMNS = ("time", "front_right", "rear_left", "front_left", "rear_right",
           "x", "y", "z", "vx", "vy", "vz", "roll", "pitch", "yaw", "p", "q", "r")


class Body:
    """On the ground at first. `held` keeps it there, whatever the motors do."""

    def __init__(self, held):
        self.held = held
        self.place, self.velocity, self.rates = [0.0] * 3, [0.0] * 3, [0.0] * 3
        self.attitude = [1.0, 0.0, 0.0, 0.0]
        self.speeds = [0.0] * 4
        self.force = [0.0, 0.0, -GRAVITY]  # specific force, body axes

    def down_axis(self):
        """The body's z axis in earth axes."""
        w, x, y, z = self.attitude
        return 2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)

    def angles(self):
        w, x, y, z = self.attitude
        return (math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
                math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x)))),
                math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))

    def step(self, commands, dt):
        """`commands` in the firmware's order: front right, rear left, front left, rear right; each 0 to 1."""
        self.speeds = [s + (max(0.0, min(1.0, c)) - s) * dt / MOTOR_LAG for s, c in zip(self.speeds, commands)]
        if self.held:
            return
        fr, rl, fl, rr = (THRUST_MAX * s * s for s in self.speeds)
        thrust, axis = fr + rl + fl + rr, self.down_axis()
        acceleration = [(-thrust * a - DRAG * v) / MASS for a, v in zip(axis, self.velocity)]
        if self.place[2] >= 0 and acceleration[2] + GRAVITY > 0:
            yaw = self.angles()[2]
            self.velocity, self.rates, self.place[2] = [0.0] * 3, [0.0] * 3, 0.0
            self.attitude, self.force = [math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)], [0.0, 0.0, -GRAVITY]
            return
        self.force = [0.0, 0.0, -thrust / MASS]  # the drag is left out: the firmware's attitude doesn't use it
        acceleration[2] += GRAVITY
        self.velocity = [v + a * dt for v, a in zip(self.velocity, acceleration)]
        self.place = [s + v * dt for s, v in zip(self.place, self.velocity)]
        p, q, r = self.rates
        ix, iy, iz = INERTIA
        torques = (ARM * (fl + rl - fr - rr) - RATE_DRAG * p + (iy - iz) * q * r,
                   ARM * (fr + fl - rl - rr) - RATE_DRAG * q + (iz - ix) * p * r,
                   YAW_TORQUE * (fr + rl - fl - rr) - RATE_DRAG * r + (ix - iy) * p * q)
        self.rates = [w + t / i * dt for w, t, i in zip(self.rates, torques, INERTIA)]
        p, q, r = self.rates
        w, x, y, z = self.attitude
        turned = [w - (x * p + y * q + z * r) * dt / 2, x + (w * p + y * r - z * q) * dt / 2,
                  y + (w * q + z * p - x * r) * dt / 2, z + (w * r + x * q - y * p) * dt / 2]
        norm = math.sqrt(sum(e * e for e in turned))
        self.attitude = [e / norm for e in turned]

    def packet(self):
        north, east, down = self.place
        return struct.pack("<18d", 1.0, *self.rates, *self.force, *self.attitude,
                           self.velocity[1], self.velocity[0], -self.velocity[2],
                           LONGITUDE + east / METRES_PER_DEGREE / math.cos(math.radians(LATITUDE)),
                           LATITUDE + north / METRES_PER_DEGREE, -down,
                           101_325 * (1 - 2.25577e-5 * -down) ** 5.25588)


class Peer:
    """Runs the body in a process of its own, 1,000 steps a second of real time. `rows()` are what it saw, a row a step."""

    def __init__(self, held=True, tilt=0.0, seconds_max=300):
        self.rows_max = int(seconds_max / STEP)
        self.table = multiprocessing.RawArray("d", self.rows_max * len(COLUMNS))
        self.count = multiprocessing.Value("q", 0)
        self.tilt = multiprocessing.Value("d", tilt)  # roll of a held body, radians
        self.process = multiprocessing.Process(target=self._run, args=(held,), daemon=True)
        self.process.start()

    def _run(self, held):
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        body, commands = Body(held), (0.0,) * 4
        inbox = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        inbox.bind(("127.0.0.1", 9002))
        inbox.setblocking(False)
        due, width = time.monotonic(), len(COLUMNS)
        while True:
            try:
                while True:
                    commands = struct.unpack_from("<4f", inbox.recv(64))
            except BlockingIOError:
                pass
            if held:
                body.attitude = [math.cos(self.tilt.value / 2), math.sin(self.tilt.value / 2), 0.0, 0.0]
            body.step(commands, STEP)
            inbox.sendto(body.packet(), ("127.0.0.1", 9003))
            row = self.count.value % self.rows_max * width
            self.table[row:row + width] = [time.monotonic(), *commands, *body.place, *body.velocity,
                                           *body.angles(), *body.rates]
            self.count.value += 1
            due += STEP
            time.sleep(max(0.0, due - time.monotonic()))

    def rows(self, since=0.0):
        """Rows from the time `since` on, oldest first."""
        width, count = len(COLUMNS), min(self.count.value, self.rows_max)
        first = self.count.value - count
        indices = range(first, first + count)
        low, high = 0, count
        while low < high:
            middle = (low + high) // 2
            if self.table[indices[middle] % self.rows_max * width] < since:
                low = middle + 1
            else:
                high = middle
        return [self.table[i % self.rows_max * width:(i % self.rows_max + 1) * width] for i in indices[low:]]

    def last(self):
        width = len(COLUMNS)
        at = (self.count.value - 1) % self.rows_max * width
        return dict(zip(COLUMNS, self.table[at:at + width]))

    def stop(self):
        self.process.terminate()
        self.process.join()
