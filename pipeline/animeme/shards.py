"""Parts of a job's lines, for farms whose unit is a command line."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass


@dataclass(frozen=True)
class Shard:
    """One of `count` parts of a job's lines, from 1: the same whatever the machine and order."""

    number: int
    count: int

    @classmethod
    def parse(cls, text: str) -> Shard:
        """The shard called ``I/N``.

        Raises:
            ValueError: it is no such thing.
        """
        number, _, count = text.partition("/")
        if not (number.isdecimal() and count.isdecimal() and 1 <= int(number) <= int(count)):
            raise ValueError(f"a shard is I/N with I from 1 to N, not {text!r}")
        return cls(int(number), int(count))

    def has(self, line: str) -> bool:
        """Whether the line with this key belongs to it."""
        return int(hashlib.sha256(line.encode()).hexdigest(), 16) % self.count == self.number - 1
