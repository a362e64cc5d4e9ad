"""What the mouths do, measured on the deformed meshes of two heads.

The measures (see `support.mouth`): *lip gap* is the vertical distance of the inner lips less that
at rest, *lip to teeth* the distance of the lower lip's rim from the upper incisors' edge, both in
units of the distance between the eyes (6.5 cm on an adult). Closed means a gap of at most 0.02, as
the design defines it for captured speech; a vowel opens from 0.03; lip and teeth meet within 0.04.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from animeme.findings import RunReport
from animeme.phones import Phone, PhoneTrack
from animeme_stages.pictures.scene import load_scene
from conftest import LANGUAGES
from support.mouth import MouthPoints, ada_mouth, ict_mouth

CLOSED = 0.02
OPEN = 0.03
CONTACT = 0.04
OPEN_VOWELS = frozenset({"a", "ɑ", "æ", "ɛ", "ʌ", "ɔ", "aɪ", "aʊ"})


def tracks(folder: Path) -> dict[str, PhoneTrack]:
    return {
        path.stem: PhoneTrack.from_document(json.loads(path.read_text(encoding="utf-8")))
        for path in sorted(folder.glob("*.json"))
    }


def spoken(track: PhoneTrack, symbols: frozenset[str]) -> Iterator[Phone]:
    for symbol, phone in zip(track.ipa(), track.phones, strict=True):
        if symbol in symbols:
            yield phone


def check_closures(mouth: MouthPoints, line: str, track: PhoneTrack) -> int:
    """Closed during all of /m/ and over the first half of /p b/; the rest of these is release."""
    count = 0
    for symbol in ("p", "b", "m"):
        for phone in spoken(track, frozenset({symbol})):
            share = 1.0 if symbol == "m" else 0.5
            at_s = np.linspace(phone.start_s, phone.start_s + share * phone.duration_s, 5)
            gaps = [mouth.lip_gap(mouth.weights_at(line, float(t))) for t in at_s]
            assert max(gaps) <= CLOSED, f"{line}: /{symbol}/ at {phone.start_s:.2f} s: {gaps}"
            count += 1
    return count


def check_vowels(mouth: MouthPoints, line: str, track: PhoneTrack) -> int:
    count = 0
    for phone in spoken(track, OPEN_VOWELS):
        at_s = np.linspace(phone.start_s, phone.end_s, 7)
        widest = max(mouth.lip_gap(mouth.weights_at(line, float(t))) for t in at_s)
        assert widest >= OPEN, f"{line}: {phone.symbol} at {phone.start_s:.2f} s: {widest:.3f}"
        count += 1
    return count


def check_labiodentals(mouth: MouthPoints, line: str, track: PhoneTrack) -> int:
    count = 0
    for phone in spoken(track, frozenset({"f", "v"})):
        middle_s = (phone.start_s + phone.end_s) / 2
        apart = mouth.lip_to_teeth(mouth.weights_at(line, middle_s))
        assert apart <= CONTACT, f"{line}: /{phone.symbol}/ at {phone.start_s:.2f} s: {apart:.3f}"
        count += 1
    return count


CHECKS = {
    "closures": check_closures,
    "vowels": check_vowels,
    "labiodentals": check_labiodentals,
}


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("check", CHECKS)
def test_ada(sample_run: tuple[RunReport, Path], language: str, check: str) -> None:
    _, output = sample_run
    mouth = ada_mouth(load_scene(output / language / "ada.glb"))
    found = tracks(output / "alignments" / language)
    assert sum(CHECKS[check](mouth, line, track) for line, track in found.items()) >= 3


@pytest.mark.parametrize("check", CHECKS)
def test_ict_head(ict_run: tuple[RunReport, Path, list[Path]], shared: Path, check: str) -> None:
    _, output, _ = ict_run
    scene = load_scene(output / "en" / "ict.glb")
    mouth = ict_mouth(scene, shared / "assets" / "ict").measured_only()
    found = tracks(output / "alignments" / "en")
    assert sum(CHECKS[check](mouth, line, track) for line, track in found.items()) >= 25


def test_measures_tell_open_from_closed(sample_run: tuple[RunReport, Path]) -> None:
    _, output = sample_run
    mouth = ada_mouth(load_scene(output / "en" / "ada.glb"))
    assert mouth.lip_gap({}) == 0.0
    assert mouth.lip_gap({"jawOpen": 0.5}) > 0.1
    assert mouth.lip_gap({"jawOpen": 0.1}) > CLOSED
    assert abs(mouth.lip_gap({"jawOpen": 0.5, "mouthClose": 0.5})) < CLOSED
    assert mouth.lip_to_teeth({"jawOpen": 0.4}) > 2 * CONTACT
    assert mouth.lip_to_teeth({}) > CONTACT
