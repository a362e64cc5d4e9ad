"""Cheap stages, and an aligner that does to its process what a file beside it says."""

from __future__ import annotations

import ctypes
import os
import subprocess
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from animeme.contracts import Alignment, Anchor, Speech
from animeme.curves import CurveSet
from animeme.phones import Phone, PhoneTrack, contiguous


class Chaotic:
    """Equal parts for the letters of the text, after what ``$CHAOS/<line>`` says is done."""

    name = "chaotic"

    def languages(self) -> frozenset[str]:
        return frozenset({"de", "en"})

    def align(
        self,
        speech: Speech,
        text: str,
        *,
        language: str,
        lexicon: Path | None = None,
        anchors: Sequence[Anchor] = (),
        voice: Path | None = None,
    ) -> Alignment:
        suffer(Path(os.environ.get("CHAOS", os.devnull)) / speech.source.stem)
        time.sleep(0.05)  # else a run would be over before anything happens to it
        letters = [letter for letter in text if letter.isalpha()][:8]
        step_s = speech.duration_s / (len(letters) + 1)
        symbols = ["AA" if letter in "aeiou" else "M" for letter in letters]
        phones = [Phone(s, n * step_s, (n + 1) * step_s) for n, s in enumerate(symbols)]
        return Alignment(PhoneTrack(language, "arpabet", contiguous(phones, speech.duration_s)))


class Flap:
    """The jaw is open on vowels."""

    name = "flap"
    controls = ("jawOpen",)

    @classmethod
    def default(cls) -> Flap:
        return cls()

    def synthesize(self, track: PhoneTrack, *, rate_hz: float) -> CurveSet:
        times_s = np.array([0.0, *(phone.end_s for phone in track.phones)])
        weights = np.array([0.0, *(0.5 * (phone.symbol == "AA") for phone in track.phones)])
        return CurveSet(times_s, self.controls, weights[:, None])

    def remarks(self, track: PhoneTrack) -> tuple[Any, ...]:
        return ()


def suffer(order: Path) -> None:
    """Do what a file says, if it is there: once, or each time."""
    try:
        what, _, often = order.read_text().partition(" ")
    except OSError:
        return
    if often == "once":
        order.unlink(missing_ok=True)
    if what == "hang":
        time.sleep(3600)
    if what == "linger":
        null = subprocess.DEVNULL
        subprocess.Popen(["sleep", "600"], stdin=null, stdout=null, stderr=null)
    if what == "segfault":
        ctypes.string_at(0)
