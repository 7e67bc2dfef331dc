"""muster for Python: run scenarios, vary them, write agents.

>>> import muster
>>> run = muster.Sim("thesis-1").run()
>>> run.figures["mission_completed"]
True
"""

from __future__ import annotations

import itertools
import json
from os import PathLike
from typing import TYPE_CHECKING, Any, Callable, Dict, Iterable, List, Literal, Mapping

from . import _muster
from ._columns import FIGURES, cells
from ._muster import Context, MusterError, SwarmEvent, Telemetry
from ._values import encode, plain
from .agents import Agent, Place

if TYPE_CHECKING:
    import matplotlib.axes
    import pandas
    import pyarrow

__all__ = ["Agent", "Campaign", "Context", "MusterError", "Place", "Run", "Sim", "SwarmEvent", "Table", "Telemetry"]


class Table(List[Dict[str, Any]]):
    """Rows as dictionaries, which pandas and Arrow take."""

    _types: Mapping[str, str] = {}
    """Of columns that have the same type in each table."""

    def to_pandas(self) -> pandas.DataFrame:
        """A pandas.DataFrame. Lists and dictionaries stay what they are. Needs pandas."""
        import pandas

        frame = pandas.DataFrame(list(self))
        return frame.astype({name: kind for name, kind in self._types.items() if name in frame})

    def to_arrow(self) -> pyarrow.Table:
        """A pyarrow.Table. Lists, dictionaries and the values of a column with several types are JSON. Needs pyarrow."""
        import pyarrow

        types = {name: pyarrow.type_for_alias(kind.lower()) for name, kind in self._types.items()}
        names = dict.fromkeys(name for row in self for name in row)
        columns = {name: cells([row.get(name) for row in self]) for name in names}
        return pyarrow.table({name: pyarrow.array(values, types.get(name)) for name, values in columns.items()})


class Run:
    """A finished run. `report` has all figures, as in `report.json`."""

    def __init__(self, report: dict[str, Any]):
        self.report = report

    @property
    def figures(self) -> dict[str, Any]:
        """The figures of the scenario's own swarm that are numbers, texts or truths. `mission_completed` is that of all swarms."""
        figures = {key: value for key, value in self.report.items() if not isinstance(value, (list, dict))}
        swarms = [self.report, *self.report.get("others", [])]
        figures["mission_completed"] = all(swarm["mission_completed"] for swarm in swarms)
        return figures

    @property
    def drones(self) -> Table:
        """A row for each drone."""
        return Table(self.report.get("drones", []))

    @property
    def elections(self) -> Table:
        """A row for each election."""
        return Table(self.report.get("elections", []))

    @property
    def observed(self) -> Table:
        """A row for each value that an agent observed."""
        return Table(self.report.get("observed", []))

    @property
    def agent_failures(self) -> Table:
        """A row for each failure of an agent, with its traceback."""
        return Table(self.report.get("agent_failures", []))

    @property
    def violations(self) -> Table:
        """A row for each rule that was broken."""
        return Table(self.report.get("violations", []))

    def plot(self, name: str, axes: matplotlib.axes.Axes | None = None) -> matplotlib.axes.Axes:
        """Plots an observed value over time, a line for each drone. Needs matplotlib."""
        rows = [row for row in self.observed if row["name"] == name]
        if not rows:
            observed = ", ".join(sorted({row["name"] for row in self.observed})) or "nothing"
            raise ValueError(f"no agent observed `{name}`; observed is {observed}")
        if axes is None:
            import matplotlib.pyplot

            _, axes = matplotlib.pyplot.subplots()
        for drone in sorted({row["drone"] for row in rows}):
            own = [row for row in rows if row["drone"] == drone]
            axes.plot([row["at_s"] for row in own], [row["value"] for row in own], label=f"drone {drone}")
        axes.set_xlabel("time, s")
        axes.set_ylabel(name)
        axes.legend()
        return axes

    def __repr__(self) -> str:
        figures = self.figures
        return f"<Run of {figures['scenario']}, seed {figures['seed']}: {figures['simulated_s']:.1f} s>"


class Campaign(Table):
    """A row for each run, as in `runs.jsonl`: the varied fields, the seed and the run's figures.

    Columns of figures have the same types in each campaign.
    """

    _types = FIGURES


class Sim:
    """A scenario that is ready to fly. Methods return a changed copy."""

    def __init__(self, scenario: str | PathLike[str], *, _sim: _muster.Sim | None = None):
        self._sim = _sim if _sim is not None else _muster.Sim(scenario)

    def set(self, field: str, value: Any) -> "Sim":
        """With a field set: to a truth, a number, a text, a path, a list or a dictionary. A path starts at the current folder."""
        return Sim("", _sim=self._sim.set(field, encode(field, value)))

    def seed(self, seed: int) -> "Sim":
        """With another random seed."""
        return Sim("", _sim=self._sim.seed(seed))

    def engine(self, name: Literal["events", "actors"]) -> "Sim":
        """On the engine "events" (the default) or "actors"; both give the same flight."""
        return Sim("", _sim=self._sim.engine(name))

    def agents(self, new: Callable[[int], Agent]) -> "Sim":
        """With agents: `new(id)` builds the one of a drone, an object with at least one of the five methods.

        `new(0)` is called once more here, and in each `set` after it, as a trial.
        """
        return Sim("", _sim=self._sim.agents(new))

    def run(self, folder: str | PathLike[str] | None = None) -> Run:
        """Flies. Writes report.html, report.json and tracks.csv into `folder` if there is one."""
        return Run(json.loads(self._sim.run_json(folder)))

    def campaign(
        self, seeds: Iterable[int], vary: Mapping[str, Iterable[Any]] | None = None
    ) -> Campaign:
        """Flies each combination of varied fields with each seed, on all processors.

        Rows are those of `muster campaign`; `observed` has the last value of each name that agents observed. Values of varied
        fields are plain: a path is a text, a tuple a list, a number of numpy one of Python.
        """
        vary = {field: [plain(value) for value in values] for field, values in (vary or {}).items()}
        texts = [(field, [encode(field, value) for value in values]) for field, values in vary.items()]
        combinations = [dict(zip(vary, values)) for values in itertools.product(*vary.values())]
        rows = Campaign()
        for row in json.loads(self._sim.campaign_json(list(seeds), texts)):
            del row["varied"]
            observed = row.pop("observed", {})
            place = {key: row.pop(key) for key in ("run", "combination")}
            fields = combinations[place["combination"]]
            rows.append({**place, **fields, **row, "observed": observed})
        return rows
