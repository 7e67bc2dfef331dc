"""Several clients: on a second MSP port (UART2 is TCP 5762), and on the same port."""

import socket
import time

import firmware
import msp
from flight import Flight

PATH = firmware.program()

flight = Flight(PATH, [*firmware.lines("safe-sole.txt"), "serial UART2 1 115200 57600 0 115200"])
flight.arm(throttle=1200)
second = msp.Link(port=5762)
sent, answered, end = 0, 0, time.monotonic() + 5
while time.monotonic() < end:
    sent += 1
    answered += second.request(msp.ATTITUDE, timeout=0.5) is not None
print(f"a client on the second port, RC and polls on the first: {answered} of {sent} requests answered in 5 s")
print(f"still armed: {flight.armed(flight.poll())}")

other = socket.create_connection(("127.0.0.1", 5761), timeout=1)
time.sleep(0.2)
other.settimeout(1)
try:
    other.sendall(msp.frame(msp.ATTITUDE))
    outcome = "closed by the firmware" if other.recv(64) == b"" else "answered"
except ConnectionError:
    outcome = "closed by the firmware"
except TimeoutError:
    outcome = "open, but no reply in 1 s"
print(f"a second client on the first port: {outcome}")
flight.run(1)
print(f"the first client goes on: armed {flight.armed(flight.seen[-1])}, flags {flight.seen[-1][1]}")
flight.sending = False

end, lost = time.monotonic() + 2, False
while time.monotonic() < end:
    second.request(msp.SET_RAW_RC, msp.channels_payload(flight.sticks), timeout=0.5)
    lost |= bool(flight.poll()[1])
print(f"RC frames from the second port instead: {'receiver lost' if lost else 'no flag in 2 s'}")
flight.link.close()
time.sleep(0.05)
reply = second.request(msp.STATUS)
print(f"the first client is gone: the second is {'answered' if reply else 'not answered'}")
flight.stop()
