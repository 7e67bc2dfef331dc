"""The data mule in gradysim, with muster's agents in Python and in Rust: lines, speed and what was delivered.

    python bench/mule.py PATH_OF_THE_EXAMPLE_agents

Needs PyPI's gradysim, the wheel of muster, and the example `agents` built for release. The world is the same: places, range,
losses, mean speed, one call and one measurement a second. gradysim's drones are in no swarm; ours leave it once they fly. Its
vehicles have no take-off and no landing, and its radio no acknowledgements: there the mule asks again until it is answered.
Its vehicles move in steps of 10 ms, its default.
"""

import csv
import json
import math
import pathlib
import random
import resource
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).parents[2]
SCENARIO = ROOT / "examples/agents/mule.toml"
PLACES = [(0.0, -200.0), (150.0, 0.0), (0.0, 200.0), (-150.0, 0.0)]
ROUNDS, DURATION_S, RANGE_M, LOSS = 3, 675.0, 60.0, 0.1
# The mean over a leg of 250 m at up to 10 m/s with 1 m/s², which gradysim's vehicles have from the start.
SPEED_MPS = 250.0 / 35.0


# gradysim: begin
def gradysim_run():
    from gradysim.protocol.interface import IProtocol
    from gradysim.protocol.messages.communication import BroadcastMessageCommand
    from gradysim.protocol.messages.mobility import GotoCoordsMobilityCommand
    from gradysim.simulator.handler.communication import CommunicationHandler, CommunicationMedium
    from gradysim.simulator.handler.mobility import MobilityConfiguration, MobilityHandler
    from gradysim.simulator.handler.timer import TimerHandler
    from gradysim.simulator.simulation import SimulationBuilder, SimulationConfiguration

    delivered = {}

    class Node(IProtocol):
        def initialize(self):
            self.id, self.count, self.pending = self.provider.get_id(), 0, None
            self.seen, self.reached = {}, 0
            if self.id == len(PLACES):
                self.go(1)
            if self.id != 0:
                self.provider.schedule_timer("tick", 1.0)

        def go(self, place):
            self.target = PLACES[place % len(PLACES)]
            self.provider.send_mobility_command(GotoCoordsMobilityCommand(*self.target, 20.0))

        def say(self, **message):
            message["from"] = self.id
            self.provider.send_communication_command(BroadcastMessageCommand(json.dumps(message)))

        def handle_timer(self, timer):
            if self.id == len(PLACES):
                self.say(kind="here")
            else:
                self.count += 1
            self.provider.schedule_timer("tick", self.provider.current_time() + 1.0)

        def handle_packet(self, text):
            message = json.loads(text)
            kind, sender = message["kind"], message["from"]
            if message.get("to", self.id) != self.id:
                return
            if kind == "here" and self.id == 0:
                self.say(kind="here", to=sender)
            elif kind == "here" and self.count:
                # The same number until it is confirmed, so that nothing counts twice.
                self.pending = self.pending or (self.provider.current_time(), self.count)
                self.say(kind="data", to=sender, token=self.pending[0], count=self.pending[1])
            elif kind == "data":
                if self.seen.get(sender) != message["token"]:
                    self.seen[sender] = message["token"]
                    self.count += message["count"]
                    delivered[self.id] = self.count
                self.say(kind="confirm", to=sender, token=message["token"])
            elif kind == "confirm" and self.pending and self.pending[0] == message["token"]:
                self.count -= self.pending[1]
                self.pending = None

        def handle_telemetry(self, telemetry):
            if self.id != len(PLACES) or self.reached > ROUNDS * len(PLACES):
                return
            if math.dist(telemetry.current_position[:2], self.target) < 1.0:
                self.reached += 1
                self.go(self.reached + 1)

        def finish(self):
            pass

    builder = SimulationBuilder(SimulationConfiguration(duration=DURATION_S, execution_logging=False))
    builder.add_handler(TimerHandler())
    builder.add_handler(CommunicationHandler(CommunicationMedium(transmission_range=RANGE_M, failure_rate=LOSS)))
    builder.add_handler(MobilityHandler(MobilityConfiguration(default_speed=SPEED_MPS)))
    for place in PLACES:
        builder.add_node(Node, (*place, 20.0))
    builder.add_node(Node, (0.0, 0.0, 20.0))
    builder.build().start_simulation()
    return DURATION_S, delivered.get(0, 0)
# gradysim: end


def python_run():
    sys.path.insert(0, str(ROOT / "python/examples"))
    import mule
    import muster

    run = muster.Sim(str(SCENARIO)).agents(mule.Mule).run()
    values = [row["value"] for row in run.observed if row["drone"] == 0]
    return run.figures["simulated_s"], max(values, default=0)


def rust_delivered(program, parameters):
    with tempfile.TemporaryDirectory() as folder:
        command = [program, "sim", str(SCENARIO), "--json", "--out", folder]
        command += ["--set", f"protocol.parameters={parameters}"]
        report = json.loads(subprocess.run(command, capture_output=True, check=True).stdout)
    values = [row["value"] for row in report.get("observed", []) if row["drone"] == 0]
    return max(values, default=0)


def rust_campaign(program, parameters):
    """Flights without the start of a program and a page for each, as the other rows have neither."""
    with tempfile.TemporaryDirectory() as folder:
        command = [program, "campaign", str(SCENARIO), "--seeds", "0..40", "--out", folder]
        command += ["--set", f"protocol.parameters={parameters}"]
        subprocess.run(command, capture_output=True, check=True)
        rows = list(csv.DictReader((pathlib.Path(folder) / "runs.csv").open()))
    return sum(float(row["simulated_s"]) for row in rows), len(rows)


def cpu_s():
    usage = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(it.ru_utime + it.ru_stime for it in usage)


def measured(run, *arguments):
    """Drone-seconds a CPU second, the best of three, and what was delivered."""
    best, delivered = 0.0, 0
    for _ in range(3):
        before = cpu_s()
        simulated_s, delivered = run(*arguments)
        best = max(best, 5 * simulated_s / (cpu_s() - before))
    return best, delivered


def lines(path, begin=None, end=None):
    text = path.read_text()
    if begin:
        text = text.split(begin)[1].split(end)[0]
    marks = ("#", "//", '"""')
    return sum(1 for line in text.splitlines() if line.strip() and not line.strip().startswith(marks))


def main():
    random.seed(1)
    rows = [("gradysim", lines(pathlib.Path(__file__), "# gradysim: begin", "# gradysim: end"), measured(gradysim_run))]
    rows.append(("Python, fast", lines(ROOT / "python/examples/mule.py"), measured(python_run)))
    # "fast" sends ten frames a second, "quiet" one, as often as gradysim's mule calls.
    for parameters in ["fast", "quiet"] if len(sys.argv) > 1 else []:
        speed, _ = measured(rust_campaign, sys.argv[1], parameters)
        count = lines(ROOT / "examples/agents/mule.rs")
        rows.append((f"Rust, {parameters}", count, (speed, rust_delivered(sys.argv[1], parameters))))
    reference = rows[0][2][0]
    print(f"{'':<16}{'lines':>8}{'drone-seconds a CPU second':>30}{'times':>9}{'delivered':>12}")
    for name, count, (speed, delivered) in rows:
        print(f"{name:<16}{count:>8}{speed:>30,.0f}{speed / reference:>9.1f}{delivered:>12.0f}")


if __name__ == "__main__":
    main()
