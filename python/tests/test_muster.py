"""What the package promises: the README's examples run, flights repeat, failures are told. Run it as a program."""

import pathlib
import re
import tempfile

import muster

ROOT = pathlib.Path(__file__).parents[2]
SCENARIO = """
seed = 1
[formation]
kind = "linear"
drones = 5
spacing_m = 60
[mission]
file = "{mission}"
[radio]
range_m = 300
loss = 0.1
[protocol]
kind = "agent"
policy = "tree"
parameters = "fast"
[agent]
name = "scout"
[agent.parameters]
side_m = 40
"""


class Failing:
    def __init__(self, id):
        self.id = id

    def telemetry(self, telemetry, cx):
        if self.id == 1:
            raise ValueError("on purpose")
        cx.land()


class Deep(Failing):
    """Fails 30 calls deep, with a cause."""

    def telemetry(self, telemetry, cx):
        self.odd(30) if self.id == 1 else cx.land()

    def odd(self, calls):
        self.even(calls - 1)

    def even(self, calls):
        if calls > 0:
            self.odd(calls - 1)
        try:
            {}["a cause"]
        except KeyError as error:
            raise ValueError("on purpose") from error


class Addressed(Failing):
    def telemetry(self, telemetry, cx):
        if self.id == 1:
            raise ValueError(f"bad {object()}")
        cx.land()


class Dice:
    """Flies to places drawn at random, and lands at the fifth."""

    def __init__(self, id):
        self.places = 0

    def start(self, cx):
        assert cx.parameters == {"side_m": 40}
        self.next(cx)

    def next(self, cx):
        north, east, altitude = cx.slot
        cx.go_to((north + cx.rng.uniform(0, 40), east, altitude))

    def telemetry(self, telemetry, cx):
        if telemetry.has_arrived:
            self.places += 1
            cx.land() if self.places == 5 else self.next(cx)


def readme_runs(folder):
    scenario = (folder / "scout.toml").as_posix()
    text = (ROOT / "python/README.md").read_text().replace('"scout.toml"', repr(scenario))
    blocks = re.findall(r"```python\n(.*?)```", text, re.S)
    assert len(blocks) == 2
    for block in blocks:
        exec(compile(block, "README.md", "exec"), {})


def flights_repeat_on_both_engines(sim):
    runs = [sim.agents(Dice).engine(engine).run() for engine in ("events", "actors", "events")]
    assert len({run.report["trace"] for run in runs}) == 1
    assert sim.agents(Dice).seed(2).run().report["trace"] != runs[0].report["trace"]
    assert runs[0].figures["mission_completed"] and not runs[0].violations


def exception_is_the_agents_failure_with_its_traceback(sim):
    run = sim.agents(Failing).run()
    assert {row["drone"] for row in run.agent_failures} == {1}
    assert 'raise ValueError("on purpose")' in run.agent_failures[0]["what"]
    assert not run.violations


def long_traceback_keeps_its_exception_and_tells_the_cause(sim):
    what = sim.agents(Deep).run().agent_failures[0]["what"]
    assert what.startswith("Traceback"), what
    assert what.endswith("ValueError: on purpose"), what
    assert "KeyError: 'a cause'" in what


def words_of_a_failure_are_no_part_of_the_trace(sim):
    flights = [sim.agents(Addressed).engine(engine).run() for engine in ("events", "actors", "events")]
    assert len({run.report["trace"] for run in flights}) == 1
    assert "bad <object object at 0x" in flights[0].agent_failures[0]["what"]


def wrong_field_is_refused_with_a_suggestion():
    try:
        muster.Sim("thesis-1").set("radio.los", 0.1)
    except muster.MusterError as error:
        assert "did you mean `radio.loss`" in str(error)
    else:
        raise AssertionError("it was accepted")


def campaigns_are_tables():
    rows = muster.Sim("thesis-1").campaign(range(3), vary={"radio.loss": [0.0, 0.1]})
    assert rows.to_pandas().shape[0] == rows.to_arrow().num_rows == 6
    assert {row["radio.loss"] for row in rows} == {0.0, 0.1}


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        mission = (ROOT / "scenarios/missions/field.waypoints").as_posix()
        (folder / "scout.toml").write_text(SCENARIO.format(mission=mission))
        sim = muster.Sim(folder / "scout.toml")
        readme_runs(folder)
        flights_repeat_on_both_engines(sim)
        exception_is_the_agents_failure_with_its_traceback(sim)
        long_traceback_keeps_its_exception_and_tells_the_cause(sim)
        words_of_a_failure_are_no_part_of_the_trace(sim)
    wrong_field_is_refused_with_a_suggestion()
    campaigns_are_tables()
    print("all hold")


if __name__ == "__main__":
    main()
