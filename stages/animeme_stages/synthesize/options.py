"""Options of models: dataclass fields that ``--set key=value`` and documents give values to."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields
from typing import Any, TypeVar, get_args, get_type_hints

from animeme.documents import suggestion

Options = TypeVar("Options")


def read_options(kind: type[Options], given: Mapping[str, Any]) -> Options:
    """An options object with `given` values in place of its defaults.

    Args:
        kind: a dataclass whose fields are of bool, int, float or a Literal of strings, with
            ``metadata={"low": …, "high": …}`` for the range of numbers.
        given: name → value, or its text.

    Raises:
        ValueError: an unknown name, or a value that the option cannot take; says what it takes.
    """
    hints = get_type_hints(kind)
    known = {field.name: field for field in fields(kind)}  # type: ignore[arg-type]
    values = {}
    for name, value in given.items():
        if name not in known:
            raise ValueError(f"there is no option '{name}'. {suggestion(name, known)}")
        values[name] = _parse(name, value, hints[name], known[name].metadata)
    return kind(**values)


def _parse(name: str, value: Any, hint: Any, limits: Mapping[str, Any]) -> Any:
    if hint is bool:
        return _boolean(name, value)
    if hint in (int, float):
        return _number(name, value, hint, limits)
    choices = get_args(hint)
    if value not in choices:
        raise ValueError(f"{name} must be one of {', '.join(choices)}, not {value!r}")
    return value


def _boolean(name: str, value: Any) -> bool:
    if isinstance(value, bool):
        return value
    words = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}
    if str(value).lower() not in words:
        raise ValueError(f"{name} must be true or false, not {value!r}")
    return words[str(value).lower()]


def _number(name: str, value: Any, kind: Any, limits: Mapping[str, Any]) -> Any:
    word = "a whole number" if kind is int else "a number"
    low, high = limits.get("low", -math.inf), limits.get("high", math.inf)
    problem = f"{name} must be {word} from {low:g} to {high:g}, not {value!r}"
    if isinstance(value, bool):
        raise ValueError(problem)
    try:
        number = kind(value)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(problem) from None
    if number != float(value) or not low <= number <= high:
        raise ValueError(problem)
    return number
