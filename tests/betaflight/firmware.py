"""Starts the firmware in a network of its own and configures it through its CLI."""

import atexit
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time

import msp

HERE = pathlib.Path(__file__).parent


def program():
    """The firmware's path, from the command line. Restarts the script in a network namespace, since the ports are fixed."""
    if len(sys.argv) < 2:
        sys.exit(f"usage: {sys.argv[0]} PROGRAM, as printed by .ci/betaflight")
    if os.environ.get("OWN_NETWORK") != "1":
        os.environ["OWN_NETWORK"] = "1"
        start = 'ip link set lo up && exec "$0" "$@"'
        os.execvp("unshare", ["unshare", "--net", "--map-root-user", "sh", "-c", start, sys.executable, *sys.argv])
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("terminated"))  # so that the firmware is stopped, too
    return sys.argv[1]


def lines(name):
    """CLI lines of a file beside this one, without comments."""
    text = (HERE / name).read_text().splitlines()
    return [line for line in text if line.strip() and not line.startswith("#")]


class Firmware:
    """A running firmware with its configuration in a folder of its own."""

    def __init__(self, path, configuration):
        self.path, self.folder, self.process = path, tempfile.mkdtemp(), None
        atexit.register(self.stop)
        for _ in range(3):
            self.start()
            try:
                self.cli([*configuration, "save"])
                self.process.wait(5)
                break
            except (OSError, subprocess.TimeoutExpired):  # now and then it hangs or dies
                pass
        self.start()

    def start(self):
        """Starts it anew until it listens: now and then it never does, several times in a row."""
        for _ in range(6):
            self.kill()
            self.process = subprocess.Popen([self.path, "127.0.0.1"], cwd=self.folder,
                                            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            started = time.monotonic()
            while time.monotonic() < started + 5:
                if ":1681 00000000:0000 0A" in pathlib.Path("/proc/net/tcp").read_text():
                    return
                time.sleep(0.02)
        raise RuntimeError("the firmware doesn't listen on port 5761")

    def kill(self):
        if self.process:
            self.process.kill()
            self.process.wait()

    def cli(self, commands):
        """Returns what the CLI answers to each command; fails on a line that the CLI refuses. Leaves the CLI without a restart."""
        link, answers = msp.Link(), []
        time.sleep(0.3)
        for command in ("#", *commands, "exit noreboot"):
            link.send(command.encode() + (b"" if command == "#" else b"\n"))
            link.buffer.clear()
            while not link.buffer.endswith(b"\r\n# "):
                try:
                    if not link.read(0.3 if command.startswith("exit") else 3):
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
        self.kill()
        shutil.rmtree(self.folder, ignore_errors=True)
