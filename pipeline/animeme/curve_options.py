"""A job's ``[curves]``: how curves are sampled, placed in time and handed out."""

from __future__ import annotations

from dataclasses import dataclass

from animeme.timing import FrameRate


@dataclass(frozen=True)
class CurveOptions:
    """How curves are sampled, placed in time and handed out: a job's ``[curves]``.

    Attributes:
        rate_hz: sampling rate of the motion, and of uniform keys where there is no `frame_rate`.
        max_error: key-reduction bound in weight units.
        uniform: a key per frame, not as few as possible.
        frame_rate: of uniform keys and time codes, or None.
        offset_s: shift of the motion against the audio, positive is later.
        preroll_s: how long before the audio the animation starts.
        export: kinds of curve files to write beside the assets.
    """

    rate_hz: float = 60.0
    max_error: float = 0.002
    uniform: bool = False
    frame_rate: FrameRate | None = None
    offset_s: float = 0.0
    preroll_s: float = 0.0
    export: tuple[str, ...] = ()
