"""Types of agents, for annotations."""

from __future__ import annotations

from typing import Protocol, Tuple, Union

from ._muster import Context, SwarmEvent, Telemetry

Place = Tuple[float, float, float]
"""Metres north of home, east of home and above home."""


class Starts(Protocol):
    """An agent with `start`: called once the drone is in its slot, and after a restart of the agent in the air."""

    def start(self, cx: Context, /) -> object: ...


class HearsTelemetry(Protocol):
    """An agent with `telemetry`: called once a period, and at once on arrival."""

    def telemetry(self, telemetry: Telemetry, cx: Context, /) -> object: ...


class HearsMessages(Protocol):
    """An agent with `message`: called for each message of another agent."""

    def message(self, sender: int, payload: bytes, cx: Context, /) -> object: ...


class HasTimers(Protocol):
    """An agent with `timer`: called when a timer expires."""

    def timer(self, timer: int, cx: Context, /) -> object: ...


class WatchesSwarm(Protocol):
    """An agent with `swarm`: called when the leader or the drones on task change, and with what became of messages."""

    def swarm(self, event: SwarmEvent, cx: Context, /) -> object: ...


Agent = Union[Starts, HearsTelemetry, HearsMessages, HasTimers, WatchesSwarm]
"""An object with at least one of the five methods."""
