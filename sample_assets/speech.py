"""The sample's dialogue: six lines in three languages, spoken by espeak-ng.

Each line is there for what a mouth does in it: closures, rounded vowels, lip to teeth, tongue.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import soundfile
import soxr

from animeme_stages.align.espeak import espeak

RATE_HZ = 16_000
# Actors leave some room before and after a line.
ROOM_S = 0.25
PEAK = 0.7

VOICES = {"en": "en-us", "de": "de", "es": "es"}
LINES: dict[str, dict[str, str]] = {
    "welcome": {
        "en": "Welcome back, my friend. We have been waiting for you.",
        "de": "Willkommen zurück, mein Freund. Wir haben auf dich gewartet.",
        "es": "Bienvenido de nuevo, mi amigo. Te estábamos esperando.",
    },
    "boat": {
        "en": "Mama bought a big blue boat for Bob.",
        "de": "Mama kauft ein großes blaues Boot für Bob.",
        "es": "Mamá compró un barco azul para Pablo.",
    },
    "moon": {
        "en": "Who knew the moon could look so cool?",
        "de": "Du suchst im Juni den großen Mond.",
        "es": "La luna de julio es una moneda azul.",
    },
    "five": {
        "en": "Five fine foxes live off the valley.",
        "de": "Fünf feine Füchse finden viel Futter.",
        "es": "Cinco zorros felices viven en la finca.",
    },
    "think": {
        "en": "They think these three things are theirs.",
        "de": "Sie denken, diese drei Dinge gehören ihnen.",
        "es": "Ellos dicen que estas diez cosas son suyas.",
    },
    "count": {
        "en": "Please wait here for 12 minutes & open the door.",
        "de": "Bitte warte 12 Minuten & öffne die Tür.",
        "es": "Por favor, espera 12 minutos y abre la puerta.",
    },
}


def build_dialogue(folder: Path) -> list[Path]:
    """Write ``dialogue/<language>/<line>.wav`` and ``.txt`` below `folder`; returns the files."""
    written: list[Path] = []
    for language, voice in VOICES.items():
        target = folder / "dialogue" / language
        target.mkdir(parents=True, exist_ok=True)
        for name, texts in LINES.items():
            text = texts[language]
            transcript, recording = target / f"{name}.txt", target / f"{name}.wav"
            transcript.write_text(text + "\n", encoding="utf-8", newline="\n")
            soundfile.write(recording, _spoken(text, voice), RATE_HZ, subtype="PCM_16")
            written += [transcript, recording]
    return written


def _spoken(text: str, voice: str) -> np.ndarray[tuple[int], np.dtype[np.int16]]:
    """Speech with room around it, int16 at `RATE_HZ`."""
    voiced = espeak().speak([text], voice, afresh=False)[0].samples.astype(np.float64) / 32768.0
    heard = np.flatnonzero(np.abs(voiced) > 1e-3)
    voiced = soxr.resample(voiced[heard[0] : heard[-1] + 1], espeak().rate_hz, RATE_HZ)
    voiced *= PEAK / np.abs(voiced).max()
    room = np.zeros(int(ROOM_S * RATE_HZ))
    padded = np.concatenate([room, voiced, room])
    # A breath of noise: digital silence is no recording, and upsets what estimates noise.
    noise = np.random.default_rng(0).standard_normal(len(padded)) * 2e-4
    return np.round((padded + noise) * 32767).astype(np.int16)
