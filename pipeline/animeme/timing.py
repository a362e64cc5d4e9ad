"""Frames and time codes: the rates of film and television, exactly.

Seconds are the truth everywhere else. A rate is a ratio of whole numbers, so that frame n of 23.976
is at n × 1001/24000 s and drifts against nothing, however long the line.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from animeme.curves import Floats

# An end that misses a frame by less than this share of one has hit it: float64 rounding of an hour.
SAME_FRAME = 1e-6
_LABEL = re.compile(r"(\d+):(\d{2}):(\d{2})([:;])(\d+)(\.\d+)?")


@dataclass(frozen=True)
class FrameRate:
    """A number of frames per second, and how they are labelled.

    Attributes:
        per_s: frames per second.
        drop_frame: labels skip numbers, so that they keep up with the clock; no frame is dropped
            (SMPTE ST 12-1, section 5.2.2).
    """

    per_s: Fraction
    drop_frame: bool = False

    @classmethod
    def parse(cls, value: str | float) -> FrameRate:
        """The rate that people write as 24, 23.976, "29.97" or "29.97df".

        Raises:
            ValueError: there is no such rate; names those that there are.
        """
        text = f"{value:g}" if isinstance(value, (int, float)) else value.strip().lower()
        try:
            return RATES[text]
        except KeyError:
            raise ValueError(f"{value!r} is no frame rate; known: {', '.join(RATES)}") from None

    @property
    def nominal(self) -> int:
        """How many frames labels count per second: 24 for 23.976."""
        return math.ceil(self.per_s)

    def time_s(self, frame: int) -> float:
        """When a frame begins, seconds, rounded once."""
        return float(frame / self.per_s)

    def times_s(self, end_s: float) -> Floats:
        """Times of the frames from 0 to the first that is not before `end_s`, shape (T,), T ≥ 2.

        Two at least, for one frame is no motion.
        """
        import numpy as np  # takes its time, and whoever parses a rate needs none

        exact = end_s * float(self.per_s)
        last = max(1, math.ceil(exact - SAME_FRAME))
        numerator, denominator = self.per_s.as_integer_ratio()
        frames = np.arange(last + 1, dtype=np.float64)
        times_s: Floats = frames * denominator / numerator
        return times_s

    def label(self, frame: int) -> str:
        """The time code of a frame: ``HH:MM:SS:FF``, with a semicolon if numbers are dropped.

        Example:
            >>> FrameRate.parse("29.97df").label(1800), FrameRate.parse("29.97").label(1800)
            ('00:01:00;02', '00:01:00:00')
        """
        number = frame + self._dropped_before(frame)
        seconds, frames = divmod(number, self.nominal)
        minutes, second = divmod(seconds, 60)
        hours, minute = divmod(minutes, 60)
        mark = ";" if self.drop_frame else ":"
        return f"{hours % 24:02d}:{minute:02d}:{second:02d}{mark}{frames:02d}"

    def frame_of(self, label: str) -> Fraction:
        """The frame that a time code names, with the part of a frame behind its point.

        Raises:
            ValueError: it is none, counts more frames than this rate has, or was never given.
        """
        match = _LABEL.fullmatch(label)
        if not match:
            raise ValueError(f"{label!r} is not HH:MM:SS:FF")
        hours, minutes, seconds, frames = (int(match[group]) for group in (1, 2, 3, 5))
        if frames >= self.nominal:
            raise ValueError(f"{label!r} counts a frame {frames}, there are {self.nominal}")
        minute = hours * 60 + minutes
        number = (minute * 60 + seconds) * self.nominal + frames
        if self.drop_frame:
            if seconds == 0 and frames < self._dropped and minute % 10:
                raise ValueError(f"{label!r} is a number that drop-frame leaves out")
            number -= self._dropped * (minute - minute // 10)
        return number + Fraction(f"0{match[6]}" if match[6] else 0)

    @property
    def _dropped(self) -> int:
        """Numbers left out each minute but every tenth: two of 30, four of 60."""
        return self.nominal // 15

    def _dropped_before(self, frame: int) -> int:
        if not self.drop_frame:
            return 0
        per_minute = self.nominal * 60 - self._dropped
        per_ten = per_minute * 10 + self._dropped
        tens, rest = divmod(frame, per_ten)
        minutes = max(0, rest - self._dropped) // per_minute
        return self._dropped * (9 * tens + minutes)


def _ntsc(nominal: int) -> Fraction:
    return Fraction(nominal * 1000, 1001)


RATES: dict[str, FrameRate] = {
    "23.976": FrameRate(_ntsc(24)),
    "24": FrameRate(Fraction(24)),
    "25": FrameRate(Fraction(25)),
    "29.97": FrameRate(_ntsc(30)),
    "29.97df": FrameRate(_ntsc(30), drop_frame=True),
    "30": FrameRate(Fraction(30)),
    "48": FrameRate(Fraction(48)),
    "50": FrameRate(Fraction(50)),
    "59.94": FrameRate(_ntsc(60)),
    "59.94df": FrameRate(_ntsc(60), drop_frame=True),
    "60": FrameRate(Fraction(60)),
}
