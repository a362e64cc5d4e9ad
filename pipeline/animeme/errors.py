"""Whose fault an error is, and what to do about it.

One root, one child per fault. Messages are for the person at the keyboard: what is wrong, where,
and the next action. The data that a program needs is in attributes. All of them pickle, because
workers raise them too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


class AnimemeError(Exception):
    """The root of every error that animeme raises on purpose."""


class InputError(AnimemeError):
    """An asset, an audio file or a text cannot be used.

    Attributes:
        code: permanent code, the same that a ``Finding`` made from this error carries.
        problem: what is wrong.
        place: the file, node or character position it is about.
        action: what the reader should do next.
    """

    def __init__(self, code: str, problem: str, *, place: str, action: str) -> None:
        super().__init__(code, problem, place, action)
        self.code = code
        self.problem = problem
        self.place = place
        self.action = action

    def __str__(self) -> str:
        return f"{self.place}: {self.problem}. {self.action} [{self.code}]"

    def __reduce__(self) -> tuple[object, ...]:
        return _input_error, (type(self), self.code, self.problem, self.place, self.action)


def _input_error(
    cls: type[InputError], code: str, problem: str, place: str, action: str
) -> InputError:
    """Rebuild a pickled error (keyword-only arguments need a helper)."""
    return cls(code, problem, place=place, action=action)


@dataclass(frozen=True)
class Problem:
    """One thing wrong with a job: its TOML path, what is wrong, what to do."""

    path: str
    message: str
    action: str = ""

    def __str__(self) -> str:
        tail = f" {self.action}" if self.action else ""
        return f"{self.path}: {self.message}.{tail}" if self.path else f"{self.message}.{tail}"


class JobError(AnimemeError):
    """A job cannot be run; all of its problems at once."""

    def __init__(self, source: str, problems: Sequence[Problem]) -> None:
        super().__init__(source, tuple(problems))
        self.source = source
        self.problems = tuple(problems)

    def __str__(self) -> str:
        count = len(self.problems)
        head = f"{self.source}: {count} problem{'s' if count != 1 else ''}"
        return "\n".join([head, *(f"  {problem}" for problem in self.problems)])


class PluginError(AnimemeError):
    """A plug-in is missing, clashes with another, or failed to load.

    Attributes:
        group: entry-point group, for example ``animeme.models``.
        name: the plug-in's name.
        distribution: the installed distribution that brought it, or "" where there is none.
        problem: what is wrong.
        action: what the reader should do next.
    """

    def __init__(
        self, group: str, name: str, distribution: str, problem: str, action: str = ""
    ) -> None:
        super().__init__(group, name, distribution, problem, action)
        self.group = group
        self.name = name
        self.distribution = distribution
        self.problem = problem
        self.action = action

    def __str__(self) -> str:
        origin = f" (from {self.distribution})" if self.distribution else ""
        tail = f" {self.action}" if self.action else ""
        return f"{self.group} '{self.name}'{origin}: {self.problem}.{tail}"
