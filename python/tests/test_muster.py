"""What the package promises: the README's examples run, flights repeat, failures are told. Run it as a program."""

import csv
import itertools
import json
import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time

import muster
from agents import (
    Addressed, Deep, Dice, Endless, Exiting, Failing, Greedy, Interrupting, Keeping, Sending, Talking, raises,
)

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


def readme_runs(folder):
    text = (ROOT / "python/README.md").read_text()
    [scenario] = re.findall(r"```toml\n(.*?)```", text, re.S)
    (folder / "scout.toml").write_text(scenario)
    blocks = re.findall(r"```python\n(.*?)```", text, re.S)
    assert len(blocks) == 2
    before = os.getcwd()
    os.chdir(folder)
    try:
        for block in blocks:
            exec(compile(block, "README.md", "exec"), {})
    finally:
        os.chdir(before)


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


def too_many_messages_and_timers_are_errors_at_the_call(sim):
    run = sim.agents(Greedy).run()
    assert not run.agent_failures, run.agent_failures[0]["what"]
    values = {(row["drone"], row["name"]): row["value"] for row in run.observed}
    assert values == {(drone, name): value for drone in range(5)
                      for name, value in (("messages", 64), ("timers", 64), ("replaced", 1))}


def agent_that_cannot_be_built_again_fails_silently(folder):
    code = f"""
import sys
sys.path[:0] = {[str(ROOT / "python/tests"), *sys.path]!r}
import agents, muster
run = muster.Sim({str(folder / "scenario.toml")!r}).agents(agents.Brittle).run()
assert run.agent_failures[-1]["what"].endswith("ValueError: only once"), run.agent_failures
"""
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (run.returncode, run.stderr) == (0, ""), run.stderr


def context_of_an_earlier_call_takes_no_commands(sim):
    run = sim.agents(Keeping).run()
    assert not run.agent_failures, run.agent_failures[0]["what"]
    assert [row["value"] for row in run.observed] == [10] * 5


def interrupts_leave_the_run(sim):
    for engine in ("events", "actors"):
        interrupted = sim.agents(Interrupting).engine(engine)
        for _ in range(2):
            with raises(KeyboardInterrupt, ""):
                interrupted.run()
        with raises(SystemExit, "enough"):
            sim.agents(Exiting).engine(engine).run()
    with raises(SystemExit, "enough"):
        sim.agents(Exiting).campaign(range(4))
    with raises(SystemExit, "built"):
        sim.agents(lambda id: sys.exit("built"))
    assert sim.agents(Dice).run().figures["mission_completed"]


def interrupt_is_raised_from_its_own_call(sim):
    """Another thread's campaign is ended, but one of its agents is busy while this thread flies the same scenario."""
    ended, is_flown, turns, raised = threading.Event(), threading.Event(), itertools.count(), []

    class Agent(Failing):
        def start(self, cx):
            if self.id or threading.current_thread() is threading.main_thread():
                return
            if next(turns) == 0:
                is_flown.wait(10)
            else:
                ended.set()
                sys.exit("enough")

        def telemetry(self, telemetry, cx):
            cx.land()

    agents = sim.agents(Agent)

    def campaign():
        try:
            agents.campaign(range(4))
        except SystemExit as error:
            raised.append(str(error))

    other = threading.Thread(target=campaign)
    other.start()
    try:
        assert ended.wait(60)
        time.sleep(0.3)
        agents.seed(7).run()
    finally:
        is_flown.set()
        other.join()
    assert raised == ["enough"], raised


def interrupt_ends_runs_and_campaigns_early(sim):
    large, endless = muster.Sim("big-matrix"), sim.agents(Endless)
    begun = time.monotonic()
    large.run()
    whole = time.monotonic() - begun
    for flies in (large.run, lambda: large.campaign(range(100)), lambda: endless.campaign(range(10_000))):
        begun = time.monotonic()
        threading.Timer(whole / 10, signal.raise_signal, [signal.SIGINT]).start()
        with raises(KeyboardInterrupt, ""):
            flies()
        assert time.monotonic() - begun < 0.8 * whole


def folder_that_cannot_be_written_is_refused_before_the_flight(sim, folder):
    built = []

    def new(id):
        built.append(id)
        return Dice(id)

    agents = sim.agents(new)
    with raises(muster.MusterError, "is not a folder"):
        agents.run(folder / "scenario.toml" / "out")
    assert built == [0]
    agents.run(folder / "out")
    assert (folder / "out/report.html").is_file()
    assert sorted(built) == [0, 0, 1, 2, 3, 4]
    (folder / "out/report.html").unlink()
    (folder / "out/report.html/in").mkdir(parents=True)
    with raises(muster.MusterError, "report.html: "):
        agents.run(folder / "out")


def scenario_is_read_once(folder):
    path = folder / "edited.toml"
    path.write_text((folder / "scenario.toml").read_text().replace("linear", "random"))
    sim = muster.Sim(path).agents(Dice)
    trace = sim.seed(3).run().report["trace"]
    path.write_text("")
    assert sim.seed(3).run().report["trace"] == trace


def campaign_ends_with_its_first_error():
    sim = muster.Sim("thesis-1").set("formation.spacing_m", 20).set("formation.drones", 30)
    sim = sim.set("formation.kind", "random").set("mission.file", "paddock").set("limits.altitude_max_m", 30)
    begun = time.monotonic()
    with raises(muster.MusterError, ""):
        sim.campaign([3, *range(1_000, 2_000)])
    assert time.monotonic() - begun < 20


def parameters_have_the_values_that_were_set(sim):
    import numpy

    seen = []

    class Reading(Dice):
        def __init__(self, id):
            self.places = 4

        def start(self, cx):
            seen.append(cx.parameters["side_m"])
            self.next(cx)

    def read(value):
        seen.clear()
        sim.set("agent.parameters.side_m", value).agents(Reading).run()
        assert all(type(it) is type(seen[0]) for it in seen)
        return seen[0]

    words = 'a "word"\n\\ \x7f \x01 é 🚁'
    for value, expected in (
        ((10, 20), [10, 20]),
        ([True, False], [True, False]),
        (True, True),
        ("true", "true"),
        ("1.10", "1.10"),
        ("12", "12"),
        ("", ""),
        ("plain/text.toml", "plain/text.toml"),
        ("inf", "inf"),
        ("1979-05-27", "1979-05-27"),
        ("[1]", "[1]"),
        (words, words),
        (1e-7, 1e-7),
        (1e16, 1e16),
        (-3, -3),
        ({"north": {"east of": 1.5}, "x": []}, {"north": {"east of": 1.5}, "x": []}),
        (pathlib.Path("some folder/x"), "some folder/x"),
        (numpy.float64(0.1), 0.1),
        (numpy.int32(7), 7),
        (numpy.bool_(True), True),
        (numpy.array([[1, 2]]), [[1, 2]]),
    ):
        found = read(value)
        assert (found, type(found)) == (expected, type(expected)), (value, found)
    for value in (None, [None], {1: 2}, {"x": None}, {1, 2}, b"x", object(), float("nan"), float("inf"), [2**63]):
        with raises(TypeError, "`agent.parameters.side_m`: "):
            sim.set("agent.parameters.side_m", value)
        with raises(TypeError, "`agent.parameters.side_m`: "):
            sim.campaign([1], vary={"agent.parameters.side_m": [1, value]})


def parameters_that_are_not_finite_are_floats(folder):
    seen = []

    class Reading(Failing):
        def start(self, cx):
            seen.append(repr(cx.parameters))

    path = folder / "not-finite.toml"
    path.write_text((folder / "scenario.toml").read_text() + "gain = inf\nlist = [1.0, nan, 2]\ntable = { low = -inf }\n")
    muster.Sim(path).agents(Reading).run()
    assert set(seen) == {"{'gain': inf, 'list': [1.0, nan, 2], 'side_m': 40, 'table': {'low': -inf}}"}, seen


def reason_of_a_dropped_message_is_told(sim):
    run = sim.agents(Sending).run()
    assert not run.agent_failures, run.agent_failures[0]["what"]
    assert len(run.observed) == 5


def outcome_has_the_number_of_a_message_sent_long_ago(sim):
    run = sim.set("radio.loss", 0).agents(Talking).run()
    assert not run.agent_failures, run.agent_failures[0]["what"]
    [sent] = [row["value"] for row in run.observed]
    assert sent > 1_024, sent


def objects_that_are_no_agents_are_refused(sim):
    for new, words in ((lambda id: None, "`new(0)` returned a NoneType"), (lambda id: 7, "returned a int")):
        with raises(muster.MusterError, words):
            sim.agents(new)


def plot_of_an_unknown_value_names_what_was_observed(sim):
    with raises(ValueError, "observed is messages, replaced, timers"):
        sim.agents(Greedy).run().plot("typo")
    with raises(ValueError, "observed is nothing"):
        sim.agents(Dice).run().plot("typo")


def wrong_field_is_refused_with_a_suggestion():
    with raises(muster.MusterError, "did you mean `radio.loss`"):
        muster.Sim("thesis-1").set("radio.los", 0.1)


def campaigns_are_tables():
    rows = muster.Sim("thesis-1").campaign(range(3), vary={"radio.loss": [0.0, 0.1]})
    assert rows.to_pandas().shape[0] == rows.to_arrow().num_rows == 6
    assert [row["radio.loss"] for row in rows] == [0.0] * 3 + [0.1] * 3
    assert [row["run"] for row in rows] == [0, 1, 2, 3, 4, 5]


def rows_have_plain_values_that_tables_take(sim):
    import numpy

    field, missions = "agent.parameters.x", [ROOT / f"scenarios/missions/{name}.waypoints" for name in ("field", "paddock")]
    for varied, values, plain, cells in (
        ("mission.file", missions, [str(path) for path in missions], [str(path) for path in missions]),
        (field, [numpy.float64(0.5), 1], [0.5, 1], [0.5, 1.0]),
        (field, [1, "a"], [1, "a"], ["1", '"a"']),
        (field, [True, 0.5], [True, 0.5], ["true", "0.5"]),
        (field, [numpy.array([1, 2]), (3,)], [[1, 2], [3]], ["[1, 2]", "[3]"]),
        (field, [{"a": numpy.int64(1)}, {"a": (missions[0],)}], [{"a": 1}, {"a": [str(missions[0])]}], None),
    ):
        rows = sim.agents(Greedy).campaign([1], vary={varied: iter(values)})
        assert [row[varied] for row in rows] == plain, rows
        assert [type(row[varied]) for row in rows] == [type(value) for value in plain]
        assert rows.to_arrow()[varied].to_pylist() == (cells or [json.dumps(value) for value in plain])
        assert list(rows.to_pandas()[varied]) == plain


def columns_have_the_same_types_in_each_campaign(sim):
    import pyarrow

    flown = [sim.agents(Greedy).campaign([2**63 - 1]), muster.Sim("two-swarms").campaign([1])]
    assert [row["election_max_s"] is None for [row] in flown] == [True, False]
    broken = muster.Campaign({**row, "rule": 3, "violation": "too near"} for row in flown[0])
    assert {"observed", *muster.Campaign._types} == set(broken[0])
    assert broken.to_arrow()["rule"].to_pylist() == [3]
    assert pyarrow.null() not in flown[0].to_arrow().schema.types
    for rows in (flown[1], broken):
        assert rows.to_arrow().schema == flown[0].to_arrow().schema
        assert rows.to_pandas().dtypes.equals(flown[0].to_pandas().dtypes)


def rows_are_those_of_the_command(folder):
    """With the program `muster`, also all figures; `.ci/python` gives it."""
    rows = muster.Sim("two-swarms").campaign(range(2), vary={"radio.loss": [0, 0.05]})
    run = muster.Sim("two-swarms").set("radio.loss", 0.05).seed(1).run()
    swarms = [run.report, *run.report["others"]]
    assert len(swarms) == 2
    assert rows[3]["trace"] == run.report["trace"]
    assert rows[3]["elections"] == sum(len(it["elections"]) for it in swarms)
    assert rows[3]["mission_completed"] == run.figures["mission_completed"]
    program = os.environ.get("MUSTER")
    if not program:
        return
    command = [program, "campaign", "two-swarms", "--seeds", "0..2", "--vary", "radio.loss=0,0.05"]
    subprocess.run([*command, "--out", folder / "command"], capture_output=True)
    with open(folder / "command/runs.csv", newline="") as file:
        for row, expected in zip(rows, csv.DictReader(file), strict=True):
            assert list(row) == [*expected, "observed"]
            for column, text in expected.items():
                assert is_written_as(row[column], text), (column, row[column], text)


def is_written_as(value, text):
    """Whether runs.csv has this for a value."""
    if value is None or isinstance(value, bool):
        return text == {None: "", True: "true", False: "false"}[value]
    return float(text) == value if isinstance(value, float) else text == str(value)


def mission_of_any_swarm_counts():
    both = {"scenario": "x", "mission_completed": True, "others": [{"mission_completed": False}]}
    assert muster.Run(both).figures["mission_completed"] is False


def campaigns_count_failures_and_have_observed_values(sim):
    rows = sim.agents(Failing).campaign(range(2))
    assert all(row["agent_failures"] > 1 for row in rows)
    assert [row["observed"] for row in sim.agents(Greedy).campaign([5])] == [{"messages": 64, "timers": 64, "replaced": 1}]


def contradictory_campaigns_are_refused():
    sim = muster.Sim("thesis-1")
    for seeds, vary, words in (
        ([1], {"seed": [1, 2]}, "can't be varied"),
        ([1], {"radio.loss": []}, "no values"),
        ([1], {"radio.loss": [0.1, 0.1]}, "twice"),
        ([1], {"radio.range_m": [200]}, "both set and varied"),
        ([1], {"radio.loss": [n / 1e4 for n in range(150)], "radio.nakagami_m": range(1, 100)}, "combinations"),
        ([], {}, "no seeds"),
        ([1, 2, 1], {}, "the seed 1 is there twice"),
    ):
        with raises(muster.MusterError, words):
            sim.set("radio.range_m", 300).campaign(seeds, vary=vary)


def main():
    # A shell's background jobs ignore it.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        mission = (ROOT / "scenarios/missions/field.waypoints").as_posix()
        (folder / "scenario.toml").write_text(SCENARIO.format(mission=mission))
        sim = muster.Sim(folder / "scenario.toml")
        readme_runs(folder)
        flights_repeat_on_both_engines(sim)
        exception_is_the_agents_failure_with_its_traceback(sim)
        long_traceback_keeps_its_exception_and_tells_the_cause(sim)
        words_of_a_failure_are_no_part_of_the_trace(sim)
        too_many_messages_and_timers_are_errors_at_the_call(sim)
        agent_that_cannot_be_built_again_fails_silently(folder)
        context_of_an_earlier_call_takes_no_commands(sim)
        folder_that_cannot_be_written_is_refused_before_the_flight(sim, folder)
        scenario_is_read_once(folder)
        reason_of_a_dropped_message_is_told(sim)
        outcome_has_the_number_of_a_message_sent_long_ago(sim)
        objects_that_are_no_agents_are_refused(sim)
        plot_of_an_unknown_value_names_what_was_observed(sim)
        parameters_have_the_values_that_were_set(sim)
        rows_have_plain_values_that_tables_take(sim)
        columns_have_the_same_types_in_each_campaign(sim)
        parameters_that_are_not_finite_are_floats(folder)
        rows_are_those_of_the_command(folder)
        campaigns_count_failures_and_have_observed_values(sim)
        interrupts_leave_the_run(sim)
        interrupt_is_raised_from_its_own_call(sim)
        interrupt_ends_runs_and_campaigns_early(sim)
    wrong_field_is_refused_with_a_suggestion()
    campaigns_are_tables()
    mission_of_any_swarm_counts()
    contradictory_campaigns_are_refused()
    campaign_ends_with_its_first_error()
    print("all hold")


if __name__ == "__main__":
    main()
