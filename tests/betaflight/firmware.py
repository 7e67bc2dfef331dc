"""Starts the firmware in a network of its own, configures it through its CLI, flies it over MSP."""

import os
import pathlib
import shutil
import socket
import statistics
import struct
import subprocess
import sys
import tempfile
import time

import msp
import physics

HERE = pathlib.Path(__file__).parent
FLAGS = ("NOGYRO FAILSAFE RXLOSS NOT_DISARMED BOXFAILSAFE RUNAWAY CRASH THROTTLE ANGLE BOOTGRACE NOPREARM LOAD CALIB CLI CMS "
         "BST MSP PARALYZE GPS RESCUE_SW DSHOT_TELEM REBOOT_REQD DSHOT_BBANG NO_ACC_CAL MOTOR_PROTO FLIP_SWITCH ALT_HOLD_SW "
         "POS_HOLD_SW ARM_SWITCH").split()  # by bit
BOX_ARM, BOX_ANGLE, BOX_FAILSAFE, BOX_OVERRIDE = 0, 1, 27, 50  # permanent ids
LOW = [1500, 1500, 1000, 1500, 1000, 1000, 1000, 1000]  # roll, pitch, throttle, yaw, AUX1 (arm), AUX2 (angle), AUX3, AUX4


def program():
    """The firmware's path, from the command line. Restarts the script in a network namespace, since the ports are fixed."""
    if len(sys.argv) < 2:
        sys.exit(f"usage: {sys.argv[0]} PROGRAM, as printed by .ci/betaflight")
    if os.environ.get("OWN_NETWORK") != "1":
        os.environ["OWN_NETWORK"] = "1"
        start = 'ip link set lo up && exec "$0" "$@"'
        os.execvp("unshare", ["unshare", "--net", "--map-root-user", "sh", "-c", start, sys.executable, *sys.argv])
    return sys.argv[1]


def lines(name):
    """CLI lines of a file beside this one, without comments."""
    text = (HERE / name).read_text().splitlines()
    return [line for line in text if line.strip() and not line.startswith("#")]


def flag_names(flags):
    return [name for bit, name in enumerate(FLAGS) if flags >> bit & 1]


def summary(values):
    """n, median and maximum, in milliseconds."""
    ms = [value * 1000 for value in values]
    return f"{len(ms)} | {statistics.median(ms):.1f} | {max(ms):.1f}"


class Firmware:
    """A running firmware with its configuration in a folder of its own."""

    def __init__(self, path, configuration):
        self.path, self.folder = path, tempfile.mkdtemp()
        self._start()
        self.cli([*configuration, "save"])
        self.process.wait(10)
        self._start()

    def _start(self):
        """Starts until it listens: about one start in forty never does."""
        for _ in range(3):
            self.process = subprocess.Popen([self.path, "127.0.0.1"], cwd=self.folder,
                                            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            self.started = time.monotonic()
            while time.monotonic() < self.started + 3:
                if ":1681 00000000:0000 0A" in pathlib.Path("/proc/net/tcp").read_text():
                    return
                time.sleep(0.02)
            self.process.kill()
            self.process.wait()
        raise RuntimeError("the firmware doesn't listen on port 5761")

    def cli(self, commands):
        """Returns what the CLI answers to each command; fails on a line that the CLI refuses. Leaves the CLI without a restart."""
        link, answers = msp.Link(), []
        time.sleep(0.3)
        for command in ("#", *commands, "exit noreboot"):
            link.send(command.encode() + (b"" if command == "#" else b"\n"))
            link.buffer.clear()
            while not link.buffer.endswith(b"\r\n# "):
                try:
                    if not link.read(3):
                        break
                except ConnectionError:
                    break
            answer = link.buffer.decode(errors="replace")
            if "###ERROR" in answer or "Invalid" in answer:
                raise ValueError(f"the CLI refuses {command!r}: {answer}")
            answers.append(answer)
        link.close()
        return answers[1:-1]

    def stop(self):
        self.process.kill()
        self.process.wait()
        shutil.rmtree(self.folder, ignore_errors=True)


class Flight:
    """A firmware with its physics and a link. Sends RC frames every `period` seconds; between them it asks for the state."""

    def __init__(self, path, configuration, held=True, pilot=None, period=0.02):
        self.firmware = Firmware(path, configuration)
        self.physics = physics.Peer(held)
        self.link = msp.Link()
        time.sleep(0.5)
        boxes = self.link.request(msp.BOXIDS, timeout=3)[1]
        self.bits = {box: bit for bit, box in enumerate(boxes)}
        self.sticks, self.pilot, self.period = list(LOW), pilot, period
        self.sending, self.sent_at, self.pilot_sent_at = True, 0.0, 0.0
        self.radio = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.seen = []  # (time, arming flags, mode bits, RC) of each poll

    def _send_sticks(self):
        now = time.monotonic()
        if self.sending and now - self.sent_at >= self.period:
            self.link.send(msp.frame(msp.SET_RAW_RC, msp.channels_payload(self.sticks)))
            self.sent_at = now
        if self.pilot and now - self.pilot_sent_at >= 0.02:
            self.radio.sendto(struct.pack("<d16H", now, *(self.pilot + [1000] * (16 - len(self.pilot)))), ("127.0.0.1", 9004))
            self.pilot_sent_at = now

    def poll(self):
        """One look at the state, as a row of `seen`."""
        self._send_sticks()
        status = self.link.request(msp.STATUS)[1]
        self._send_sticks()
        channels = self.link.request(msp.RC)[1]
        modes = struct.unpack_from("<I", status, 6)[0]
        extra = status[15]
        modes |= int.from_bytes(status[16:16 + extra], "little") << 32
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
        self.link.close()
        self.physics.stop()
        self.firmware.stop()
