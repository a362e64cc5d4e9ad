"""The dominated animeme models, whole: what they learn, keep and promise."""

from __future__ import annotations

import copy
import json
import os
import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from animeme import registry
from animeme.errors import InputError
from animeme.phones import SILENCE, Phone, PhoneTrack
from animeme.scoring import judge
from animeme.training import parse_options, save_model
from animeme_stages.synthesize.dam import Dam
from support.motion import captured, captured_line

FITTED = ("bigram", "cohen-massaro", "dam", "dam-2009", "mmm")
FIXTURE = Path(__file__).parent / "fixtures" / "model-dam.1.json"
QUICK = {"rounds": 10, "depth": 3, "leaf": 5}


@pytest.fixture(scope="module")
def model() -> Dam:
    return Dam.configured(QUICK).fit(captured(lines=30))


@pytest.mark.slow
def test_trees_beat_one_mode_where_context_matters() -> None:
    """Held-out error: context modes < one mode < one mode of degree 0."""
    data, other = captured(lines=80), captured(lines=15, first=900)
    errors = []
    for options in ({}, {"modes": "none"}, {"modes": "none", "degree": 0}):
        score, _ = judge(Dam.configured({**options, "contacts": False}).fit(data), other)
        errors.append(sum(value or 0.0 for value in score.rmse.values()))
    assert errors[0] < errors[1] < errors[2]


def test_a_saved_model_moves_bit_exactly_the_same(model: Dam, tmp_path: Path) -> None:
    save_model(model, tmp_path / "m.animeme")
    loaded = registry.load_model(file=tmp_path / "m.animeme")
    for seed in range(200, 205):
        track = captured_line(seed).track
        assert loaded.synthesize(track, rate_hz=60) == model.synthesize(track, rate_hz=60)
    save_model(loaded, tmp_path / "again.animeme")
    first, second = (tmp_path / name for name in ("m.animeme", "again.animeme"))
    assert first.read_bytes() == second.read_bytes()


def test_the_frozen_document_still_moves_as_it_did() -> None:
    """Documents of version 1 stay readable for ever; the curve was written with the document."""
    entry = json.loads(FIXTURE.read_text(encoding="utf-8"))
    loaded = Dam.from_document(entry["document"])
    curves = loaded.synthesize(captured_line(7).track, rate_hz=25)
    np.testing.assert_allclose(curves.weights, np.array(entry["weights"]), atol=1e-9)
    assert loaded.to_document() == entry["document"]


@pytest.mark.slow
def test_fitting_does_not_depend_on_the_hash_seed(tmp_path: Path) -> None:
    script = (
        "import sys; from support.motion import captured;"
        "from animeme import registry; from animeme.training import save_model;"
        "save_model(registry.model_type(sys.argv[1]).configured(dict(a.split('=') for a in"
        " sys.argv[3:])).fit(captured(lines=8)), sys.argv[2])"
    )
    for name, options in (("dam", ["rounds=5"]), ("dam", ["modes=affinity"]), ("bigram", [])):
        found = []
        for seed in ("0", "1"):
            path = tmp_path / f"{name}-{seed}.json"
            paths = os.pathsep.join([str(Path(__file__).parent), *sys.path])
            subprocess.run(
                [sys.executable, "-c", script, name, str(path), *options],
                env={**os.environ, "PYTHONHASHSEED": seed, "PYTHONPATH": paths},
                check=True,
            )
            found.append(path.read_bytes())
        assert found[0] == found[1]


def held(symbol: str, length_s: float) -> PhoneTrack:
    ends = [0.3, 0.4, 0.4 + length_s, 0.5 + length_s, 0.8 + length_s]
    symbols = [SILENCE, "S", symbol, "T", SILENCE]
    starts = [0.0, *ends[:-1]]
    phones = (Phone(*entry) for entry in zip(symbols, starts, ends, strict=True))
    return PhoneTrack("en", "arpabet", tuple(phones))


@pytest.mark.parametrize("length_s", [2.0, 8.0, 60.0])
def test_a_held_vowel_stays_as_it_is(model: Dam, length_s: float) -> None:
    """Singing: open in the middle, still, and as wide as in speech."""
    curves = model.synthesize(held("AA", length_s), rate_hz=60)
    middle = (curves.times_s > 1.0) & (curves.times_s < length_s - 0.2)
    gap = curves.curve("lip_gap")[middle]
    assert np.ptp(gap) < 1e-9
    assert 0.15 < gap[0] < 0.32


@pytest.mark.parametrize("name", FITTED)
def test_no_model_explodes_in_long_or_short_phones(name: str) -> None:
    fitted = registry.model_type(name).configured({}).fit(captured(lines=30))
    limits = np.concatenate([line.values for line in captured(lines=30).lines])
    low, high, spread = limits.min(0), limits.max(0), np.ptp(limits, axis=0)
    tracks = [held("AA", length_s) for length_s in (0.01, 0.5, 3.0, 30.0)]
    for track in tracks:
        weights = fitted.synthesize(track, rate_hz=60).weights
        assert (weights > low - spread).all()
        assert (weights < high + spread).all()


def test_phones_never_seen_move_like_the_nearest(model: Dam) -> None:
    phones = {"p": "b", "ɱ": "f", "ɑː": "ɑ", "z": "s", "y": "u", "v": "f", "t͡s": "s", "ʊ": "u"}
    for symbol, like in phones.items():
        assert model.stand_in(symbol.replace("ː", "")) == like
    parts = [(SILENCE, 0.3), ("ʊ", 0.2), ("p", 0.1), ("a", 0.2), (SILENCE, 0.3)]
    ends = np.cumsum([length for _, length in parts]).round(3).tolist()
    made = (Phone(s, a, b) for (s, _), a, b in zip(parts, [0.0, *ends[:-1]], ends, strict=True))
    track = PhoneTrack("de", "ipa", tuple(made))
    (remark,) = model.remarks(track)
    assert remark.code == "model-phone-unseen"
    assert "/p/ like /b/" in remark.message
    curves = model.synthesize(track, rate_hz=60)
    inside = (curves.times_s > 0.5) & (curves.times_s < 0.56)
    assert curves.curve("lip_gap")[inside].max() < 0.02
    assert not list(model.remarks(captured_line(3).track))


def test_phones_seen_once_are_fitted_and_mentioned() -> None:
    data = captured(lines=1)
    fitted = Dam.configured(QUICK).fit(data)
    assert any(f.code == "dataset-phone-seldom" for f in fitted.findings_)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"degre": "3"}, "Did you mean 'degree'"),
        ({"degree": "9"}, "from 0 to 8"),
        ({"degree": "2.5"}, "whole number"),
        ({"degree": "many"}, "whole number"),
        ({"modes": "some"}, "context, affinity, none"),
        ({"normalise": "perhaps"}, "true or false"),
        ({"sigma": "nan"}, "a number from"),
        ({"sigma": "-1"}, "a number from"),
    ],
)
def test_options_that_make_no_sense(options: dict[str, str], said: str) -> None:
    with pytest.raises(InputError) as caught:
        Dam.configured(options)
    assert caught.value.code == "model-option"
    assert said in caught.value.problem


def test_options_need_values() -> None:
    assert parse_options(["a=1", " b = x=y "]) == {"a": "1", "b": "x=y"}
    with pytest.raises(InputError, match="key=value"):
        parse_options(["degree"])


def without(*path: str) -> Any:
    def harm(document: dict[str, Any]) -> None:
        for key in path[:-1]:
            document = document[key]
        del document[path[-1]]

    return harm


def with_(value: Any, *path: Any) -> Any:
    def harm(document: dict[str, Any]) -> None:
        for key in path[:-1]:
            document = document[key]
        document[path[-1]] = value

    return harm


HARMS = [
    without("learned"),
    without("learned", "leaves"),
    without("controls"),
    without("seen"),
    with_({}, "seen"),
    with_(["lip_gap", "lip_gap"], "controls"),
    with_("lip_gap", "controls"),
    with_(7, "config", "degree"),
    with_("pickle", "config", "modes"),
    with_(True, "config", "surprise"),
    with_([], "learned", "coefficients"),
    with_(float("nan"), "learned", "coefficients", 0, 0, 0),
    with_("__import__('os')", "learned", "coefficients", 0, 0, 0),
    with_(-1.0, "learned", "sigma", 0, 0, 0),
    with_(10**6, "learned", "asked", 0, 0),
    with_([["is", 9, "ɑ", 0]], "learned", "questions"),
    with_([["eval", 0, "ɑ", 0]], "learned", "questions"),
    with_([["is", 0, "os.system", 0]], "learned", "questions"),
    with_(None, "learned"),
    with_([1, 2], "contacts"),
]


@pytest.mark.parametrize("harm", HARMS)
def test_broken_documents_are_refused(model: Dam, harm: Any) -> None:
    document = copy.deepcopy(json.loads(json.dumps(model.to_document())))
    assert Dam.from_document(document).controls == model.controls
    harm(document)
    with pytest.raises(ValueError, match=r"."):
        Dam.from_document(document)


def boom(*_: object) -> None:
    raise AssertionError("code of a model file ran")


class Trap:
    def __reduce__(self) -> Any:
        return boom, ()


@pytest.mark.parametrize("suffix", [".json", ".animeme", ".toml"])
@pytest.mark.parametrize("kind", ["truncated", "future", "other", "pickle", "empty"])
def test_files_that_are_no_model(model: Dam, tmp_path: Path, kind: str, suffix: str) -> None:
    path = tmp_path / f"m{suffix}"
    save_model(model, path)
    data = path.read_bytes()
    changed = {
        "truncated": data[: len(data) // 2],
        "future": data.replace(b"animeme.model/1", b"animeme.model/2", 1),
        "other": data.replace(b"animeme.model/1", b"animeme.curves/1", 1),
        "pickle": pickle.dumps(Trap()),
        "empty": b"",
    }
    path.write_bytes(changed[kind])
    with pytest.raises(InputError) as caught:
        registry.load_model(file=path)
    assert caught.value.code.startswith(("document-", "model-"))
    assert str(path) in caught.value.place
    if kind == "future" and suffix != ".toml":
        assert "newer animeme" in caught.value.action
