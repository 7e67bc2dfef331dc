"""MSP frames, and a TCP link that carries them. Byte order is little-endian; times are seconds of the monotonic clock."""

import select
import socket
import struct
import time

API_VERSION, FC_VARIANT, FC_VERSION, BOARD_INFO, BUILD_INFO, NAME = 1, 2, 3, 4, 5, 10
BATTERY_CONFIG, MODE_RANGES, FEATURE_CONFIG, RX_CONFIG, CF_SERIAL_CONFIG, SONAR = 32, 34, 36, 44, 54, 58
ARMING_CONFIG, RX_MAP, FAILSAFE_CONFIG, RXFAIL_CONFIG, PID_ADVANCED, RC_TUNING = 61, 64, 75, 77, 94, 111
STATUS, RAW_IMU, MOTOR, RC, RAW_GPS, ATTITUDE, ALTITUDE, ANALOG = 101, 102, 104, 105, 106, 108, 109, 110
BOXNAMES, BOXIDS, BATTERY_STATE, STATUS_EX, UID = 116, 119, 130, 150, 160
SET_ARMING_DISABLED, SET_RAW_RC, SET_MOTOR = 99, 200, 214


def frame(code, payload=b""):
    """A version 1 request."""
    body = bytes([len(payload), code]) + payload
    checksum = 0
    for byte in body:
        checksum ^= byte
    return b"$M<" + body + bytes([checksum])


def frame_v2(code, payload=b""):
    """A version 2 request; its checksum is CRC-8/DVB-S2."""
    body = struct.pack("<BHH", 0, code, len(payload)) + payload
    crc = 0
    for byte in body:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ 0xD5) & 0xFF if crc & 0x80 else crc << 1
    return b"$X<" + body + bytes([crc])


def channels_payload(channels):
    return struct.pack(f"<{len(channels)}H", *channels)


def frame_size(buffer):
    """The size of the frame that starts the buffer: version 1, jumbo or version 2; None while it can't be told."""
    if len(buffer) < 6 or buffer[:2] == b"$X" and len(buffer) < 9 or buffer[3] == 255 and len(buffer) < 8:
        return None
    if buffer[1] == ord("X"):
        return 9 + struct.unpack_from("<H", buffer, 6)[0]
    return 6 + buffer[3] if buffer[3] < 255 else 8 + struct.unpack_from("<H", buffer, 5)[0]


def take_frame(buffer):
    """Removes the first frame and returns its bytes, or None. The firmware's replies hold no noise."""
    size = frame_size(buffer)
    if size is None or len(buffer) < size:
        return None
    taken = bytes(buffer[:size])
    del buffer[:size]
    return taken


def parts(taken):
    """(direction, code, payload) of a frame."""
    if taken[1] == ord("X"):
        return chr(taken[2]), struct.unpack_from("<H", taken, 4)[0], taken[8:-1]
    return chr(taken[2]), taken[4], taken[5 if taken[3] < 255 else 7:-1]


class Link:
    """A connection to the firmware's first serial port."""

    def __init__(self, timeout=10.0, port=5761):
        deadline = time.monotonic() + timeout
        while True:
            try:
                self.socket = socket.create_connection(("127.0.0.1", port), timeout=1)
                break
            except OSError:
                if time.monotonic() > deadline:
                    raise
                time.sleep(0.05)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.buffer = bytearray()
        self.chunks = None  # set to a list to keep what each read returned

    def send(self, data):
        self.socket.sendall(data)

    def read(self, timeout):
        """Appends what arrives within `timeout` seconds; False if nothing does."""
        if not select.select([self.socket], [], [], max(0, timeout))[0]:
            return False
        chunk = self.socket.recv(65536)
        if not chunk:
            raise ConnectionError("the firmware closed the connection")
        self.buffer += chunk
        if self.chunks is not None:
            self.chunks.append(chunk)
        return True

    def receive(self, timeout=1.0):
        """The next frame as (direction, code, payload), or None."""
        deadline = time.monotonic() + timeout
        while True:
            taken = take_frame(self.buffer)
            if taken:
                return parts(taken)
            if not self.read(deadline - time.monotonic()):
                return None

    def request(self, code, payload=b"", timeout=1.0):
        """The reply to one request: (direction, payload); None after `timeout`."""
        self.send(frame(code, payload))
        deadline = time.monotonic() + timeout
        while (taken := self.receive(deadline - time.monotonic())):
            if taken[1] == code:
                return taken[0], taken[2]
        return None

    def close(self):
        self.socket.close()
