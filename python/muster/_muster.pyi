from random import Random
from typing import Any, Callable, Literal

Place = tuple[float, float, float]
"""Metres north of home, east of home and above home."""

class MusterError(Exception):
    """A scenario, a field or a run was refused."""

class Telemetry:
    """A drone's motion."""

    position: Place
    velocity: Place
    """Metres per second north, east and up."""
    has_arrived: bool

class SwarmEvent:
    """A change in the swarm."""

    kind: Literal[
        "leader_changed",
        "leader_silent",
        "leader_returned",
        "members_lost",
        "members_joined",
        "message_delivered",
        "message_expired",
        "message_dropped",
    ]
    drones: list[int]
    message: int | None

class Context:
    """What an agent can read and do."""

    now: float
    """Seconds since the start of the run."""
    id: int
    drones: int
    drones_on_task: list[int]
    leader: int
    is_leader: bool
    slot: Place
    position: Place
    waypoints: list[Place]
    kept: bytes | None
    parameters: dict[str, Any]
    rng: Random

    def go_to(self, place: Place) -> None: ...
    def track(self, place: Place, velocity: Place) -> None: ...
    def hold(self) -> None: ...
    def land(self) -> None: ...
    def send(
        self, to: Literal["leader", "neighbours", "all"] | int, payload: bytes, acknowledged: bool = False
    ) -> int: ...
    def set_timer(self, timer: int, seconds: float) -> None: ...
    def set_telemetry(self, seconds: float | None) -> None: ...
    def cancel_timer(self, timer: int) -> None: ...
    def keep(self, kept: bytes) -> None: ...
    def observe(self, name: str, value: float) -> None: ...

class Sim:
    def __init__(self, scenario: str) -> None: ...
    def set(self, field: str, value: str) -> Sim: ...
    def seed(self, seed: int) -> Sim: ...
    def engine(self, name: str) -> Sim: ...
    def agents(self, new: Callable[[int], Any]) -> Sim: ...
    def run_json(self, folder: str | None = None) -> str: ...
    def campaign_json(self, seeds: list[int], vary: list[tuple[str, list[str]]]) -> str: ...
