"""Types of columns, as pandas and Arrow both name them."""

from __future__ import annotations

import json
from typing import Any, Sequence

from ._values import plain

FIGURES = {
    "run": "int64",
    "combination": "int64",
    "seed": "int64",
    "engine": "string",
    "trace": "string",
    "simulated_s": "float64",
    "drones": "int64",
    "landed": "int64",
    "finished": "int64",
    "flight_time_master_s": "float64",
    "flight_time_mean_s": "float64",
    "flight_time_max_s": "float64",
    "messages_received_mean": "float64",
    "messages_sent_mean": "float64",
    "barriers": "int64",
    "waypoint_wait_mean_ms": "float64",
    "transmissions_per_barrier": "float64",
    "keep_alives_per_barrier": "float64",
    "retries_per_barrier": "float64",
    "waypoint_delay_mean_s": "float64",
    "elections": "int64",
    "elections_unsettled": "int64",
    "election_max_s": "float64",
    "following_mean_m": "float64",
    "following_p95_m": "float64",
    "following_max_m": "float64",
    "medium_collided": "Int64",
    "medium_lost": "Int64",
    "medium_given_up": "Int64",
    "min_separation_m": "float64",
    "restarts": "int64",
    "agent_failures": "int64",
    "mission_completed": "bool",
    "never_injected": "int64",
    "violations": "int64",
    "rule": "Int64",
    "violation": "string",
}
"""Of a campaign's rows, without the varied fields and what agents observed. `Int64` may lack values."""


def cells(values: Sequence[Any]) -> list[Any]:
    """Values of one type. Lists and dictionaries are JSON, and so is each value if there are several types."""
    values = [plain(value) for value in values]
    kinds = {type(value) for value in values if value is not None}
    if kinds == {int, float}:
        return [None if value is None else float(value) for value in values]
    if len(kinds) <= 1 and not kinds & {list, dict}:
        return values
    return [None if value is None else json.dumps(value) for value in values]
