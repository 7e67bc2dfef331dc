from os import PathLike
from random import Random
from typing import Any, Callable, Literal, final

from .agents import Agent, Place

__all__ = ["Context", "MusterError", "Sim", "SwarmEvent", "Telemetry"]

class MusterError(Exception):
    """A scenario, a field or a run was refused."""

@final
class Telemetry:
    """A drone's motion."""

    @property
    def position(self) -> Place: ...
    @property
    def velocity(self) -> Place:
        """Metres per second north, east and up."""
    @property
    def has_arrived(self) -> bool:
        """Whether the drone has just come to rest at the destination of `go_to`: true once for each call of it."""

@final
class SwarmEvent:
    """A change in the swarm."""

    @property
    def kind(
        self,
    ) -> Literal[
        "leader_changed",
        "leader_silent",
        "leader_returned",
        "members_lost",
        "members_joined",
        "message_delivered",
        "message_expired",
        "message_dropped",
    ]: ...
    @property
    def drones(self) -> list[int]:
        """The drones that it is about: the new leader, or members."""
    @property
    def message(self) -> int | None:
        """The number of the message that it is about. None if that was sent without acknowledgement before 1,024 others."""
    @property
    def reason(self) -> str | None:
        """Why a message was dropped."""

@final
class Context:
    """What an agent can read and do. It belongs to one call: later it takes no commands."""

    @property
    def now(self) -> float:
        """Seconds since the start of the run."""
    @property
    def id(self) -> int: ...
    @property
    def drones(self) -> int:
        """Number of drones at take-off."""
    @property
    def drones_on_task(self) -> list[int]: ...
    @property
    def leader(self) -> int: ...
    @property
    def is_leader(self) -> bool: ...
    @property
    def slot(self) -> Place: ...
    @property
    def position(self) -> Place: ...
    @property
    def altitude_max_m(self) -> float:
        """Highest altitude that an agent may fly to, in metres above home."""
    @property
    def waypoints(self) -> list[Place]: ...
    @property
    def kept(self) -> bytes | None:
        """The state kept before a restart."""
    @property
    def parameters(self) -> dict[str, Any]:
        """`agent.parameters` of the scenario: truths, numbers, texts, lists and dictionaries."""
    @property
    def rng(self) -> Random: ...
    def go_to(self, place: Place) -> None: ...
    def track(self, place: Place, velocity: Place) -> None: ...
    def hold(self) -> None: ...
    def leave(self) -> None: ...
    def land(self) -> None: ...
    def send(
        self, to: Literal["leader", "neighbours", "all"] | int, payload: bytes, acknowledged: bool = False
    ) -> int: ...
    def set_timer(self, timer: int, seconds: float) -> None: ...
    def set_telemetry(self, seconds: float | None) -> None: ...
    def cancel_timer(self, timer: int) -> None: ...
    def keep(self, kept: bytes) -> None: ...
    def observe(self, name: str, value: float) -> None: ...

@final
class Sim:
    def __new__(cls, scenario: str | PathLike[str]) -> Sim: ...
    def set(self, field: str, value: str) -> Sim: ...
    def seed(self, seed: int) -> Sim: ...
    def engine(self, name: str) -> Sim: ...
    def agents(self, new: Callable[[int], Agent]) -> Sim: ...
    def run_json(self, folder: str | PathLike[str] | None = None) -> str: ...
    def campaign_json(self, seeds: list[int], vary: list[tuple[str, list[str]]]) -> str: ...
