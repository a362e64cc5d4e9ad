"""PocketSphinx's own forced alignment in two passes: what ours is measured against."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pocketsphinx
from numpy.typing import NDArray

Sounds = tuple[str, ...]


class TwoPass:
    """One decoder, at its own beams but for ``bestpath``, which fails on many right lines."""

    def __init__(self, **settings: Any) -> None:
        model = pocketsphinx.get_model_path("en-us")
        self._decoder = pocketsphinx.Decoder(
            pocketsphinx.Config(
                hmm=f"{model}/en-us",
                dict=f"{model}/cmudict-en-us.dict",
                lm=None,
                bestpath=False,
                loglevel="FATAL",
                **settings,
            )
        )

    def teach(self, name: str, variants: Sequence[Sounds]) -> None:
        """Add a word that the dictionary lacks."""
        if self._decoder.lookup_word(name) is None:
            for number, sounds in enumerate(variants, 1):
                key = name if number == 1 else f"{name}({number})"
                self._decoder.add_word(key, " ".join(sounds), False)

    def align(
        self, samples: NDArray[np.int16], words: Sequence[str]
    ) -> list[tuple[str, int, int, list[tuple[str, int, int]]]] | None:
        """(word, first frame, frames, phones (name, first frame, frames)); None where it fails."""
        decoder, data = self._decoder, samples.tobytes()
        decoder.reinit_feat()
        decoder.set_align_text(" ".join(words))
        self._decode(data)
        if decoder.hyp() is None:
            return None
        try:
            decoder.set_alignment()
            self._decode(data)
        except RuntimeError:
            return None
        return [
            (
                word.name.split("(")[0],
                word.start,
                word.duration,
                [(phone.name, phone.start, phone.duration) for phone in word],
            )
            for word in decoder.get_alignment()
            if not word.name.startswith(("<", "[", "+", "("))
        ]

    def _decode(self, data: bytes) -> None:
        self._decoder.start_utt()
        self._decoder.process_raw(data, full_utt=True)
        self._decoder.end_utt()
