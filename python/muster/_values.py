"""Values of fields as TOML, as `--set` takes them."""

from __future__ import annotations

import json
import math
import os
import re
from typing import Any

_PLAIN = re.compile(r"[A-Za-z_/.][A-Za-z0-9_/.-]*")
"""A text that is no other value of TOML, but the keywords."""
_KEYWORDS = {"true", "false", "inf", "nan"}
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")


def encode(field: str, value: Any) -> str:
    """The value of a field. Texts stay plain where they can't be mistaken for another value."""
    value = plain(value)
    if isinstance(value, str) and _PLAIN.fullmatch(value) and value not in _KEYWORDS:
        return value
    try:
        return _literal(value)
    except TypeError as error:
        raise TypeError(f"`{field}`: {error}") from None


def plain(value: Any) -> Any:
    """Paths as texts, tuples as lists; numpy's scalars and arrays, and values of derived types, as Python's. Others stay."""
    if isinstance(value, os.PathLike):
        value = os.fspath(value)
    tolist = getattr(value, "tolist", None)
    if callable(tolist):
        value = tolist()
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, dict):
        return {plain(key): plain(item) for key, item in value.items()}
    for kind, base in ((int, int.__int__), (float, float.__float__), (str, str.__str__)):
        if isinstance(value, kind) and not isinstance(value, bool):
            return base(value)
    return value


def _literal(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        if not -(2**63) <= value < 2**63:
            raise TypeError(f"{value} has more than 64 bits")
        return repr(value)
    if isinstance(value, float):
        if not math.isfinite(value):
            raise TypeError(f"{value} is not finite")
        return repr(value)
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, list):
        return f"[{', '.join(_literal(item) for item in value)}]"
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{_key(key)} = {_literal(item)}' for key, item in value.items())} }}"
    accepted = "truths, numbers, texts, paths, lists, tuples and dictionaries of these"
    raise TypeError(f"{value!r} is no value of a scenario; accepted are {accepted}")


def _key(key: Any) -> str:
    if not isinstance(key, str):
        raise TypeError(f"the key {key!r} is no text")
    return key if _BARE_KEY.fullmatch(key) else _text(key)


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
