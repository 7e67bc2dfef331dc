"""A data mule in Python: as `examples/agents/mule.rs`, in the same scenario."""

import pathlib
import struct
import sys

import muster

MEASURE, CALL, END = 0, 1, 2
BASE = 0
HERE = b"here"
SCENARIO = pathlib.Path(__file__).parents[2] / "examples/agents/mule.toml"


class Mule:
    """Drone 0 is the base, the last drone the mule, all others are sensors."""

    def __init__(self, id):
        self.count = 0
        self.sent = None
        self.reached = 0

    def above(self, place, cx):
        """Above a place, at an altitude of the drone's own."""
        places = cx.parameters["places_m"]
        north, east = places[place % len(places)]
        return north, east, cx.slot[2] + 6.0 * cx.id

    def start(self, cx):
        cx.set_telemetry(None)
        cx.leave()
        if cx.id == cx.drones - 1:
            cx.set_timer(CALL, 1.0)
            cx.go_to(self.above(1, cx))
            return
        cx.set_timer(END, cx.parameters["duration_s"])
        if cx.id != BASE:
            cx.set_timer(MEASURE, 1.0)
        cx.go_to(self.above(cx.id, cx))

    def telemetry(self, telemetry, cx):
        if not telemetry.has_arrived or cx.id != cx.drones - 1:
            return
        self.reached += 1
        if self.reached > cx.parameters["rounds"] * len(cx.parameters["places_m"]):
            cx.land()
        else:
            cx.go_to(self.above(self.reached + 1, cx))

    def message(self, sender, payload, cx):
        if payload != HERE:
            self.count += struct.unpack("<I", payload)[0]
            cx.observe("measurements", self.count)
        elif cx.id == BASE:
            cx.send(sender, HERE)
        elif self.count and self.sent is None:
            message = cx.send(sender, struct.pack("<I", self.count), acknowledged=True)
            self.sent = message, self.count

    def timer(self, timer, cx):
        if timer == END:
            cx.land()
            return
        if timer == MEASURE:
            self.count += 1
        else:
            cx.send("neighbours", HERE)
        cx.set_timer(timer, 1.0)

    def swarm(self, event, cx):
        if self.sent and event.message == self.sent[0]:
            if event.kind == "message_delivered":
                self.count -= self.sent[1]
            self.sent = None


if __name__ == "__main__":
    run = muster.Sim(sys.argv[1] if len(sys.argv) > 1 else SCENARIO).agents(Mule).run()
    print(run)
    print("delivered to the base:", max(row["value"] for row in run.observed if row["drone"] == BASE))
