"""A scripted autopilot on pymavlink: what ArduCopter says and does in GUIDED and LAND, on simple kinematics."""

import math
import os
import threading
import time

os.environ["MAVLINK20"] = "1"
from pymavlink import mavutil  # noqa: E402

mav = mavutil.mavlink
GUIDED, LAND = 4, 9
ACCELERATION_MPS2, LANDING_MPS = 2.0, 1.5
TICK_S = 0.02
FAILSAFE_S = 5  # ArduPilot's default of FS_GCS_TIMEOUT


class Autopilot(threading.Thread):
    """Starts at `origin` (latitude and longitude in degrees, altitude in metres) and sends to `companion`, "HOST:PORT"."""

    def __init__(self, origin, companion):
        super().__init__(daemon=True)
        self.link = mavutil.mavlink_connection(f"udpout:{companion}", source_system=1, source_component=1)
        self.origin = origin
        self.armed, self.mode, self.landed = False, 0, mav.MAV_LANDED_STATE_ON_GROUND
        self.position, self.velocity, self.target = [0.0] * 3, [0.0] * 3, None
        self.speed_mps, self.climb_mps = 5.0, 2.5
        self.heard = time.monotonic()
        self.asked = {mav.MAVLINK_MSG_ID_HEARTBEAT: [1.0, 0.0]}
        self.commands = []
        self.legs = []  # targets, each with the distance from the one before when it came, in metres

    def run(self):
        stepped = time.monotonic()
        while True:
            try:
                while (message := self.link.recv_msg()) is not None:
                    self.take(message)
            except ConnectionRefusedError:
                pass  # nobody listens yet
            now = time.monotonic()
            while stepped + TICK_S <= now:  # small steps, however busy the machine is
                stepped += TICK_S
                self.step(TICK_S)
            for number, (interval, due) in list(self.asked.items()):
                if due <= now:
                    self.asked[number][1] = now + interval
                    self.tell(number)
            time.sleep(0.02)

    def take(self, message):
        kind = message.get_type()
        if kind == "HEARTBEAT":
            self.heard = time.monotonic()
        elif kind == "SET_POSITION_TARGET_LOCAL_NED":
            target = (message.x, message.y, message.z)
            if self.mode == GUIDED and self.armed and target != self.target:
                self.legs.append((target, math.dist(self.position, self.target or self.position)))
                self.target = target
        elif kind == "COMMAND_LONG":
            accepted = self.execute(message)
            result = mav.MAV_RESULT_ACCEPTED if accepted else mav.MAV_RESULT_DENIED
            self.link.mav.command_ack_send(message.command, result)
            self.tell(mav.MAVLINK_MSG_ID_HEARTBEAT)

    def execute(self, message):
        command = message.command
        if command == mav.MAV_CMD_SET_MESSAGE_INTERVAL:
            self.asked[int(message.param1)] = [message.param2 / 1e6, 0.0]
            return True
        self.commands.append(mav.enums["MAV_CMD"][command].name)
        if command == mav.MAV_CMD_DO_SET_MODE:
            self.mode = int(message.param2)
        elif command == mav.MAV_CMD_COMPONENT_ARM_DISARM:
            self.armed = self.armed or self.mode == GUIDED
            return self.armed
        elif command == mav.MAV_CMD_NAV_TAKEOFF:
            if not self.armed or self.landed != mav.MAV_LANDED_STATE_ON_GROUND:
                return False
            self.target = (self.position[0], self.position[1], -message.param7)
            self.landed = mav.MAV_LANDED_STATE_TAKEOFF
        elif command == mav.MAV_CMD_DO_CHANGE_SPEED:
            if message.param1 == 1:
                self.speed_mps = message.param2
            else:
                self.climb_mps = message.param2
        elif command == mav.MAV_CMD_NAV_LAND:
            self.mode = LAND
        else:
            return False
        return True

    def step(self, seconds):
        if self.armed and self.mode != LAND and time.monotonic() - self.heard > FAILSAFE_S:
            self.mode = LAND
        wanted = [0.0] * 3
        if self.armed and self.mode == LAND:
            wanted = [0.0, 0.0, LANDING_MPS]
        elif self.armed and self.target:
            wanted = self.velocity_to(self.target)
        change = [to - at for to, at in zip(wanted, self.velocity)]
        most = ACCELERATION_MPS2 * seconds
        share = min(1.0, most / max(math.hypot(*change), 1e-9))
        self.velocity = [at + share * by for at, by in zip(self.velocity, change)]
        self.position = [at + by * seconds for at, by in zip(self.position, self.velocity)]
        if self.armed and self.mode == LAND:
            self.landed = mav.MAV_LANDED_STATE_LANDING
            if self.position[2] >= 0:
                self.armed, self.landed = False, mav.MAV_LANDED_STATE_ON_GROUND
                self.position[2], self.velocity = 0.0, [0.0] * 3
        elif self.landed == mav.MAV_LANDED_STATE_TAKEOFF and math.dist(self.position, self.target) < 0.3:
            self.landed = mav.MAV_LANDED_STATE_IN_AIR

    def velocity_to(self, target):
        """Straight, no faster than allowed over ground and up or down, and so that it can brake."""
        offset = [to - at for to, at in zip(target, self.position)]
        length = max(math.hypot(*offset), 1e-9)
        over_ground, vertical = math.hypot(offset[0], offset[1]) / length, abs(offset[2]) / length
        fastest = min(self.speed_mps / max(over_ground, 1e-9), self.climb_mps / max(vertical, 1e-9),
                      math.sqrt(ACCELERATION_MPS2 * length), length / 0.2)
        return [by * fastest / length for by in offset]

    def tell(self, number):
        to = self.link.mav
        if number == mav.MAVLINK_MSG_ID_HEARTBEAT:
            mode = mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | (mav.MAV_MODE_FLAG_SAFETY_ARMED if self.armed else 0)
            to.heartbeat_send(mav.MAV_TYPE_QUADROTOR, mav.MAV_AUTOPILOT_ARDUPILOTMEGA, mode, self.mode, mav.MAV_STATE_ACTIVE)
        elif number == mav.MAVLINK_MSG_ID_LOCAL_POSITION_NED:
            to.local_position_ned_send(0, *self.position, *self.velocity)
        elif number == mav.MAVLINK_MSG_ID_EXTENDED_SYS_STATE:
            to.extended_sys_state_send(mav.MAV_VTOL_STATE_UNDEFINED, self.landed)
        elif number == mav.MAVLINK_MSG_ID_SYS_STATUS:
            to.sys_status_send(0, 0, 0, 0, 16000, -1, 90, 0, 0, 0, 0, 0, 0)
        elif number == mav.MAVLINK_MSG_ID_SIM_STATE:
            to.sim_state_send(1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0)
        elif number == mav.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN:
            latitude, longitude, altitude_m = self.origin
            to.gps_global_origin_send(round(latitude * 1e7), round(longitude * 1e7), round(altitude_m * 1e3))
