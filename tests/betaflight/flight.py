"""Flies the firmware over MSP: sticks on time, and a look at its state whenever it answers."""

import socket
import statistics
import struct
import threading
import time

import msp
import physics
from firmware import Firmware

FLAGS = ("NOGYRO FAILSAFE RXLOSS NOT_DISARMED BOXFAILSAFE RUNAWAY CRASH THROTTLE ANGLE BOOTGRACE NOPREARM LOAD CALIB CLI CMS "
         "BST MSP PARALYZE GPS RESCUE_SW DSHOT_TELEM REBOOT_REQD DSHOT_BBANG NO_ACC_CAL MOTOR_PROTO FLIP_SWITCH ALT_HOLD_SW "
         "POS_HOLD_SW ARM_SWITCH").split()  # by bit
BOX_ARM, BOX_ANGLE, BOX_FAILSAFE, BOX_OVERRIDE = 0, 1, 27, 50  # permanent ids
LOW = [1500, 1500, 1000, 1500, 1000, 1000, 1000, 1000]  # roll, pitch, throttle, yaw, AUX1 (arm), AUX2 (angle), AUX3, AUX4


def flag_names(flags):
    return [name for bit, name in enumerate(FLAGS) if flags >> bit & 1]


def summary(values):
    """n, median and maximum, in milliseconds."""
    ms = [value * 1000 for value in values]
    return f"{len(ms)} | {statistics.median(ms):.1f} | {max(ms):.1f}"


class Flight:
    """A firmware with its physics and a link. A thread sends RC frames every 20 ms, the pilot's radio frames too. One flies at a
    time: if an error has ended the flight before, it is stopped.

    `start` makes the firmware, or what stands in its place, from a program and its configuration."""

    flying = None

    def __init__(self, path, configuration, held=True, pilot=None, start=Firmware):
        if Flight.flying:
            Flight.flying.stop()
        self.link, self.stopped, self.unanswered = None, False, 0
        self.firmware = start(path, configuration)
        self.physics = physics.Peer(held)
        Flight.flying = self
        self.sticks, self.pilot, self.sending, self.sent_at = list(LOW), pilot, True, 0.0
        self.radio = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.radio_on = False  # the firmware forgets a radio that sends while it starts
        self.seen = []  # (time, arming flags, mode bits, RC) of each poll
        threading.Thread(target=self._send_sticks, daemon=True).start()
        self._connect()

    def _connect(self):
        """Now and then the firmware starts without its receiver task: then it is started again."""
        for _ in range(4):
            try:
                self.link = msp.Link()
                self.bits = {box: bit for bit, box in enumerate(self.ask(msp.BOXIDS))}
                if self.wait(lambda row: row[3][3] == 1000, 4):
                    self.radio_on = True
                    return
            except OSError:
                pass
            self.firmware.start()
        raise RuntimeError("the firmware doesn't take RC frames")

    def _send_sticks(self):
        due = time.monotonic()
        while not self.stopped:
            now = time.monotonic()
            try:
                if self.sending and self.link:
                    self.link.send(msp.frame(msp.SET_RAW_RC, msp.channels_payload(self.sticks)))
                    self.sent_at = now
            except OSError:
                pass  # between two starts
            if self.pilot and self.radio_on:
                frame = struct.pack("<d16H", now, *(self.pilot + [1000] * (16 - len(self.pilot))))
                self.radio.sendto(frame, ("127.0.0.1", 9004))
            due = max(due + 0.02, now)
            time.sleep(max(0.0, due - time.monotonic()))

    def silence(self):
        """Stops the RC frames; the time of the last one."""
        self.sending = False
        time.sleep(0.002)
        return self.sent_at

    def ask(self, code):
        """The payload of a reply; asks again if none comes, which a busy machine can cause."""
        for _ in range(3):
            reply = self.link.request(code, timeout=2)
            if reply:
                return reply[1]
            self.unanswered += 1
        raise ConnectionError(f"no reply to {code}")

    def poll(self):
        """One look at the state, as a row of `seen`."""
        status, channels = self.ask(msp.STATUS), self.ask(msp.RC)
        extra = status[15]
        modes = struct.unpack_from("<I", status, 6)[0] | int.from_bytes(status[16:16 + extra], "little") << 32
        flags = struct.unpack_from("<I", status, 17 + extra)[0]
        self.seen.append((time.monotonic(), flags, modes, struct.unpack(f"<{len(channels) // 2}H", channels)))
        return self.seen[-1]

    def run(self, seconds):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.poll()

    def wait(self, condition, timeout):
        """Polls until `condition(row)`; the time of that poll, or None."""
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            row = self.poll()
            if condition(row):
                return row[0]
        return None

    def mode(self, row, box):
        return bool(row[2] >> self.bits[box] & 1)

    def armed(self, row):
        return self.mode(row, BOX_ARM)

    def arm(self, throttle=1000, switches=None):
        """From a fresh start: waits until nothing but the switch keeps it from arming, then arms."""
        self.wait(lambda row: row[1] == 0, 12)
        switches = switches or self.sticks
        switches[4] = 1800
        if not self.wait(self.armed, 2):
            raise RuntimeError(f"not armed: {flag_names(self.seen[-1][1])}")
        switches[2] = throttle

    def stop(self):
        Flight.flying, self.stopped = None, True
        if self.link:
            self.link.close()
        self.physics.stop()
        self.firmware.stop()
