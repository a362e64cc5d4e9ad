"""The `dam` that is shipped: what it covers, whose data it is, and that it speaks."""

from __future__ import annotations

import json
from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest

from animeme import registry, testing
from animeme.dataset import Dataset
from animeme.phones import ARPABET_TO_IPA, Phone, PhoneTrack, contiguous
from animeme_stages.retarget.profile_files import shipped_profile
from animeme_stages.synthesize.articulation import letters
from animeme_stages.synthesize.dam import Dam
from support.motion import captured

FILE = files("animeme_stages.synthesize") / "dam_grid.json"


@pytest.fixture(scope="module")
def shipped() -> Dam:
    return Dam.default()


def said(*symbols: str, phone_s: float = 0.15) -> PhoneTrack:
    ends = np.arange(1, len(symbols) + 1) * phone_s
    phones = [Phone(symbol, end - phone_s, end) for symbol, end in zip(symbols, ends, strict=True)]
    return PhoneTrack("en", "ipa", contiguous(phones, float(ends[-1])))


def test_says_whose_data_it_is_and_stays_small() -> None:
    data = FILE.read_bytes()
    assert len(data) <= 1_000_000
    credits = json.loads(data)["credits"]
    assert "GRID corpus" in credits
    assert "CC BY 4.0" in credits
    assert "Cooke" in credits
    assert Dam.default().to_document()["credits"] == credits


def test_passes_the_suite(shipped: Dam) -> None:
    testing.check_model(shipped)
    rebuilt = registry.model_type("dam").from_document(
        json.loads(json.dumps(shipped.to_document()))
    )
    track = said("sil", "m", "a", "sil")
    np.testing.assert_array_equal(
        rebuilt.synthesize(track, rate_hz=60).weights, shipped.synthesize(track, rate_hz=60).weights
    )


def test_drives_arkit_alike_on_both_sides(shipped: Dam) -> None:
    assert set(shipped.controls) <= set(shipped_profile("arkit").drives)
    curves = shipped.synthesize(said("sil", "i", "p", "u", "f", "ɑ", "sil"), rate_hz=60)
    for name in shipped.controls:
        if name.endswith("Left"):
            other = name.removesuffix("Left") + "Right"
            np.testing.assert_array_equal(curves.curve(name), curves.curve(other))


@pytest.mark.parametrize("symbols", [tuple(ARPABET_TO_IPA.values()), letters()], ids=["en", "ipa"])
def test_covers_every_phone(shipped: Dam, symbols: tuple[str, ...]) -> None:
    for symbol in symbols:
        curves = shipped.synthesize(said("sil", "a", symbol, "a", "sil"), rate_hz=60)
        assert np.isfinite(curves.weights).all()
        assert np.abs(curves.weights).max() < 1.5, symbol


@pytest.mark.parametrize("symbol", ["p", "b", "m", "f", "v"])
def test_contacts_are_reached_between_open_vowels(shipped: Dam, symbol: str) -> None:
    curves = shipped.synthesize(said("sil", "a", symbol, "a", "sil"), rate_hz=60)
    at = (curves.times_s >= 0.3) & (curves.times_s <= 0.3 + 0.6 * 0.15)
    vowel = (curves.times_s > 0.15) & (curves.times_s < 0.3)
    assert curves.curve("jawOpen")[at].max() < 0.08
    assert curves.curve("jawOpen")[vowel].max() > 0.15
    assert (curves.curve("mouthRollLower")[at].min() > 0.4) == (symbol in "fv")


def test_rounded_vowels_are_narrower(shipped: Dam) -> None:
    spread, rounded = (
        shipped.synthesize(said("sil", "s", vowel, "s", "sil"), rate_hz=60) for vowel in "iu"
    )
    for name, sign in (("mouthPucker", 1), ("mouthStretchLeft", -1)):
        assert sign * (rounded.curve(name).max() - spread.curve(name).max()) > 0.03


def test_equal_controls_are_learned_once() -> None:
    dataset = captured(lines=8)
    doubled = Dataset(
        (*dataset.controls, "again"),
        tuple(replace(line, values=line.values[:, [0, 1, 2, 0]]) for line in dataset.lines),
    )
    model = Dam.configured({"rounds": 5}).fit(doubled)
    assert model.controls == doubled.controls
    curves = model.synthesize(doubled.lines[0].track, rate_hz=60)
    np.testing.assert_array_equal(curves.curve("again"), curves.curve(doubled.controls[0]))
    document = model.to_document()
    assert document["copies"] == {"again": doubled.controls[0]}
    for broken in ({"again": "nobody"}, {doubled.controls[1]: doubled.controls[0]}):
        with pytest.raises(ValueError, match="copies"):
            Dam.from_document({**document, "copies": broken})
