"""A plot of one line's timings: waveform, words, phones with scores, and what was found."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from animeme.files import atomic_path
from animeme.findings import Finding, Severity
from animeme.phones import SILENCE, PhoneTrack
from animeme_stages.ingest.audio import decode
from animeme_stages.pictures import style
from animeme_stages.pictures.raster import Floats
from animeme_stages.pictures.strip import fitted

# So many pixels show a second, but a short line is not too small and a long one not too large.
_PER_SECOND = 260.0
_NARROWEST, _WIDEST = 900, 12_000
_LEFT, _RIGHT, _GAP = 62, 16, 10
_HEAD, _WAVE, _WORDS, _PHONES, _SCORES, _AXIS, _LINE = 38, 120, 30, 26, 54, 26, 20
_MOST_FINDINGS = 20
_COLOURS = {
    Severity.INFO: style.FAINT,
    Severity.WARNING: style.WARNING,
    Severity.ERROR: style.ERROR,
}


def plot_alignment(
    audio: Path,
    track: PhoneTrack,
    findings: Sequence[Finding],
    output: Path,
    *,
    title: str = "",
) -> None:
    """Draw when each word and phone of a recording was found, as a PNG.

    Args:
        audio: the recording.
        track: its words and phones.
        findings: written below.
        output: the PNG to write.
        title: written above; the recording's name if empty.

    Raises:
        InputError: the recording cannot be read, or the output cannot be written.
    """
    decoded = decode(audio)
    image = _Plot(decoded.samples[:, 0].astype(np.float64), decoded.rate_hz, track, findings).image
    ImageDraw.Draw(image).text(
        (_LEFT, _HEAD / 2),
        fitted(title or audio.name, style.font(15, bold=True), image.width - _LEFT - _RIGHT),
        style.INK,
        style.font(15, bold=True),
        anchor="lm",
    )
    with atomic_path(output) as scratch:
        image.save(scratch, format="PNG", optimize=True)


class _Plot:
    """Lanes one below the other over one axis of time."""

    def __init__(
        self, samples: Floats, rate_hz: int, track: PhoneTrack, findings: Sequence[Finding]
    ) -> None:
        self.duration_s = max(track.duration_s, len(samples) / rate_hz)
        wide = int(np.clip(self.duration_s * _PER_SECOND, _NARROWEST, _WIDEST))
        self.scale = wide / self.duration_s
        scored = any(phone.score is not None for phone in track.phones)
        lanes = [_WAVE, _WORDS, _PHONES, *([_SCORES] if scored else []), _AXIS]
        shown = list(findings)[:_MOST_FINDINGS]
        below = _LINE * (len(shown) + (len(findings) > len(shown))) + (_GAP if shown else 0)
        size = _LEFT + wide + _RIGHT, _HEAD + sum(lanes) + _GAP * (len(lanes) - 1) + below + _GAP
        self.image = Image.new("RGB", size, style.PAPER)
        self.draw = ImageDraw.Draw(self.image)
        top = _HEAD
        self._wave(samples, rate_hz, top, wide)
        self._words(track, top := top + _WAVE + _GAP)
        self._phones(track, top := top + _WORDS + _GAP)
        top += _PHONES + _GAP
        if scored:
            self._scores(track, top)
            top += _SCORES + _GAP
        self._axis(top)
        top += _AXIS + _GAP
        for finding in shown:
            self._finding(finding, top)
            top += _LINE
        if len(findings) > len(shown):
            self._text(_LEFT, top, f"and {len(findings) - len(shown)} more", style.FAINT)

    def _x(self, time_s: float) -> float:
        return _LEFT + time_s * self.scale

    def _text(self, x: float, top: float, text: str, colour: style.Rgb) -> None:
        font = style.font(12)
        room = self.image.width - x - _RIGHT
        self.draw.text((x, top + _LINE / 2), fitted(text, font, room), colour, font, anchor="lm")

    def _lane(self, name: str, top: int, height: int) -> None:
        place = (_LEFT - 10, top + height / 2)
        self.draw.text(place, name, style.FAINT, style.font(11), anchor="rm")

    def _wave(self, samples: Floats, rate_hz: int, top: int, wide: int) -> None:
        """The loudest and the quietest sample of each column of pixels."""
        self._lane("sound", top, _WAVE)
        box = (_LEFT, top, _LEFT + wide, top + _WAVE)
        self.draw.rectangle(box, fill=(255, 255, 255), outline=style.RULE)
        peak = max(float(np.abs(samples).max(initial=0.0)), 1e-6)
        cuts = (np.arange(wide + 1) / self.scale * rate_hz).astype(int)
        middle, half = top + _WAVE / 2, _WAVE / 2 - 4
        for k in range(wide):
            piece = samples[cuts[k] : max(cuts[k + 1], cuts[k] + 1)]
            if len(piece):
                low, high = float(piece.min()) / peak, float(piece.max()) / peak
                ends = (_LEFT + k, middle - high * half, _LEFT + k, middle - low * half)
                self.draw.line(ends, style.SERIES[4])

    def _span(
        self, start_s: float, end_s: float, top: int, height: int, text: str, fill: style.Rgb
    ) -> None:
        """A box over a stretch of time, with as much of its text as there is room for."""
        left, right = self._x(start_s), self._x(end_s)
        self.draw.rectangle((left, top, right, top + height), fill=fill, outline=style.RULE)
        font = style.font(13)
        if font.getlength(text) > right - left - 2:
            font = style.font(10)
        said = fitted(text, font, right - left - 1)
        if said not in ("", "…"):
            place = ((left + right) / 2, top + height / 2)
            self.draw.text(place, said, style.INK, font, anchor="mm")

    def _words(self, track: PhoneTrack, top: int) -> None:
        self._lane("words", top, _WORDS)
        for word in track.words:
            self._span(word.start_s, word.end_s, top, _WORDS, word.text, (226, 236, 248))
            x = self._x(word.start_s)
            self.draw.line((x, _HEAD, x, _HEAD + _WAVE), style.RULE)

    def _phones(self, track: PhoneTrack, top: int) -> None:
        self._lane("phones", top, _PHONES)
        for phone in track.phones:
            pause = phone.symbol == SILENCE
            fill = style.PAPER if pause else (255, 255, 255)
            text = "" if pause else phone.symbol
            self._span(phone.start_s, phone.end_s, top, _PHONES, text, fill)

    def _scores(self, track: PhoneTrack, top: int) -> None:
        """Mean acoustic log scores as bars, from the worst of the line to the best."""
        known = [phone.score for phone in track.phones if phone.score is not None]
        low, high = min(known), max(known)
        self._lane("score", top, _SCORES)
        for text, y in ((f"{high:.1f}", top + 6), (f"{low:.1f}", top + _SCORES - 6)):
            self.draw.text((_LEFT - 10, y), text, style.PALE, style.font(9), anchor="rm")
        floor = top + _SCORES
        for phone in track.phones:
            if phone.score is None:
                continue
            part = (phone.score - low) / (high - low) if high > low else 1.0
            pause = phone.symbol == SILENCE
            box = (
                self._x(phone.start_s) + 1,
                floor - 3 - part * (_SCORES - 5),
                max(self._x(phone.end_s) - 1, self._x(phone.start_s) + 1),
                floor,
            )
            self.draw.rectangle(box, fill=style.RULE if pause else style.SERIES[0])

    def _axis(self, top: int) -> None:
        """Seconds, as close as they can be read."""
        self._lane("s", top, _AXIS)
        step_s = next(
            s for s in (0.1, 0.2, 0.5, 1, 2, 5, 10, 30, 60, 300, 1e9) if s * self.scale > 48
        )
        self.draw.line((_LEFT, top, self._x(self.duration_s), top), style.FAINT)
        for k in range(int(self.duration_s / step_s) + 1):
            x = self._x(k * step_s)
            self.draw.line((x, top, x, top + 4), style.FAINT)
            self.draw.text(
                (x, top + 14), f"{k * step_s:g}", style.FAINT, style.font(10), anchor="mm"
            )

    def _finding(self, finding: Finding, top: int) -> None:
        colour = _COLOURS.get(finding.severity, style.INK)
        self.draw.rectangle((_LEFT, top + 6, _LEFT + 8, top + 14), fill=colour)
        place = f" ({finding.place})" if finding.place else ""
        self._text(_LEFT + 16, top, f"{finding.code}: {finding.message}{place}", style.INK)
