"""Contract suites: what every plug-in has to pass, ours and a studio's.

Call one from a test of your own::

    from animeme.testing import check_model

    def test_my_model():
        check_model(MyModel.default())

Each raises AssertionError with a sentence that says which clause was broken.
"""

from __future__ import annotations

import hashlib
import json
import pickle
import re
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import cast

import numpy as np

from animeme import registry
from animeme.contracts import Aligner, Check, Format, LineAnimation, Model, Speech
from animeme.curves import CurveSet
from animeme.dataset import CapturedLine, Dataset
from animeme.delivery import DeliveryCheck
from animeme.errors import InputError
from animeme.phones import ARPABET, SILENCE, Phone, PhoneTrack, contiguous

RATE_HZ = 60.0


def sample_tracks() -> list[PhoneTrack]:
    """Tracks that a model must cope with: every phone, none, one, very short and very long ones."""
    every = [symbol for symbol, _, _ in ARPABET]
    return [
        _track(every, 0.08),
        _track([SILENCE], 1.0),
        _track(["AA"], 0.05),
        _track(["M"], 0.03),
        _track(["B", "B", "M", "P"], 0.03),
        _track(["AA", "M", "IY"], 4.0),
        _track(["P", "AA"], 120.0),
        PhoneTrack("de", "ipa", (Phone("ʔ", 0, 0.1), Phone("øː", 0.1, 0.3), Phone("ʘ", 0.3, 0.4))),
    ]


def _track(symbols: Sequence[str], length_s: float) -> PhoneTrack:
    phones = [Phone(s, i * length_s, (i + 1) * length_s) for i, s in enumerate(symbols)]
    return PhoneTrack("en", "arpabet", contiguous(phones, len(symbols) * length_s))


def check_model(model: Model) -> None:
    """A model gives finite curves from 0 to the track's end, repeatably, and survives saving."""
    document = json.loads(json.dumps(model.to_document(), allow_nan=False))
    assert document.get("schema") == "animeme.model/1", "to_document must name its schema"
    assert document.get("model") == model.name, "to_document must name its model"
    rebuilt = type(model).from_document(document)
    assert rebuilt.controls == model.controls, "a saved model must have the same controls"
    assert len(set(model.controls)) == len(model.controls), "controls must be distinct"
    for track in sample_tracks():
        curves = model.synthesize(track, rate_hz=RATE_HZ)
        assert curves.names == model.controls, "every control must have a curve, in order"
        assert curves.times_s[0] == 0.0, "curves must start at 0"
        assert curves.duration_s == track.duration_s, "curves must end with the track"
        gap_s = np.diff(curves.times_s).max(initial=0.0)
        assert gap_s <= 1 / RATE_HZ + 1e-9, "curves must be sampled at rate_hz or finer"
        assert curves == model.synthesize(track, rate_hz=RATE_HZ), "same input, same curves"
        assert curves == rebuilt.synthesize(track, rate_hz=RATE_HZ), "saving must change nothing"
    for broken in ({}, {"schema": "animeme.model/1", "model": model.name, "config": {}}):
        try:
            type(model).from_document(broken)
        except ValueError:
            continue
        raise AssertionError("from_document must raise ValueError on an incomplete document")


def check_fit(kind: type[Model], dataset: Dataset) -> Model:
    """A model fits itself to a dataset repeatably, copes with gaps, and can refuse.

    Args:
        kind: the model's class.
        dataset: some lines with captured motion, without gaps.

    Returns:
        The fitted model, which has passed `check_model`.
    """
    before = [line.values.copy() for line in dataset.lines]
    model = kind.configured({}).fit(dataset)
    assert model.controls == dataset.controls, "a fitted model drives the dataset's controls"
    check_model(model)
    again = kind.configured({}).fit(dataset)
    assert again.to_document() == model.to_document(), "same dataset, same model"
    for line, values in zip(dataset.lines, before, strict=True):
        assert np.array_equal(line.values, values), "fitting must not change the dataset"
    errors = []
    for line in dataset.lines:
        curves = model.synthesize(line.track, rate_hz=RATE_HZ)
        errors.append(curves.sample(line.times_s) - line.values)
    spread = np.concatenate(before).std(axis=0)
    assert (np.concatenate(errors).std(axis=0) < spread).all(), "fitting must beat the mean"
    seen = {symbol for line in dataset.lines for symbol in line.track.ipa()}
    track = next(t for t in sample_tracks() if not set(t.ipa()) <= seen)
    assert list(model.remarks(track)), "phones that were never seen must be mentioned"
    gaps = [_with_gap(line, i % len(dataset.controls)) for i, line in enumerate(dataset.lines)]
    check_model(kind.configured({}).fit(dataset.subset(gaps)))
    check_model(kind.configured({}).fit(dataset.subset(dataset.lines[:1])))
    for options, lines in (({"no such option": 1}, dataset.lines), ({}, ())):
        try:
            kind.configured(options).fit(dataset.subset(lines))
        except InputError:
            continue
        raise AssertionError("an unknown option and an empty dataset must raise InputError")
    return model


def _with_gap(line: CapturedLine, column: int) -> CapturedLine:
    """`line` without one control, and without the others for a while."""
    values = line.values.copy()
    values[:, column] = np.nan
    values[len(values) // 3 : len(values) // 2] = np.nan
    return CapturedLine(line.id, line.track, line.times_s, values)


def check_aligner(aligner: Aligner, speech: Speech, text: str, *, language: str) -> None:
    """An aligner covers the recording, says the text, does not depend on order, and can refuse.

    Args:
        aligner: under test.
        speech, text, language: a line that it should align.
    """
    assert language.split("-")[0] in aligner.languages(), "languages() must list what it aligns"
    first = aligner.align(speech, text, language=language)
    track = first.track
    assert abs(track.duration_s - speech.duration_s) < 1e-6, "the track must cover the recording"
    assert track.words, "a track of speech must have words"
    for word in track.words:
        start, end = word.source
        assert 0 <= start < end <= len(text), "each word must say where in the text it stands"
    noise = np.random.default_rng(0).normal(0, 500, len(speech.samples)).astype(np.int16)
    for bad_speech, bad_text in ((speech, "…"), (speech, text * 200), (_with(speech, noise), text)):
        with suppress(InputError):  # the only way to refuse; noise may also be aligned and flagged
            aligner.align(bad_speech, bad_text, language=language)
    assert aligner.align(speech, text, language=language) == first, "order must not matter"
    try:
        aligner.align(speech, text, language=language, voice=speech.source)
    except InputError:
        pass
    else:
        raise AssertionError("a recording is no voice: it must be refused with InputError")
    try:
        aligner.align(speech, text, language="zxx")
    except InputError:
        return
    raise AssertionError("an unknown language must be refused with InputError")


def _with(speech: Speech, samples: np.ndarray[tuple[int], np.dtype[np.int16]]) -> Speech:
    return Speech(speech.source, samples, speech.rate_hz, speech.duration_s)


def check_format(form: Format, asset: Path, folder: Path) -> None:
    """A format reads a character, adds lines without harm, reads them back, and repeats itself.

    Args:
        form: under test.
        asset: a sound file of that format, with blendshapes.
        folder: an empty folder to write to.
    """
    before = _digest(asset)
    character = form.load(asset)
    assert character.format == form.name, "a character must name its format"
    assert character.shapes, "a character must have shapes"
    pickle.loads(pickle.dumps(character))
    lines = [_animation(f"line{i}", character.shapes, seed=i) for i in range(3)]
    target = folder / f"spoken{form.output_suffix(asset)}"
    written = form.write(character, lines, target)
    assert written[0] == target, "write must return its target first"
    assert all(path.is_file() for path in written), "write must return the files it wrote"
    bytes_before = [path.read_bytes() for path in written]
    assert form.harm(character, target) == [], "writing must not harm the asset"
    found = form.read_animations(target)
    for line in lines:
        back = found[line.name]
        columns = [back.names.index(name) for name in line.curves.names]
        at_s = np.linspace(0, line.duration_s, 50)
        error = np.abs(back.sample(at_s)[:, columns] - line.curves.sample(at_s)).max()
        assert error < 1e-4, f"weights read back differ by {error}"
    form.write(character, lines, target)
    assert [path.read_bytes() for path in written] == bytes_before, "same input, same bytes"
    assert _digest(asset) == before, "the source must not change"
    with suppress(InputError):  # a format that writes beside the source has nothing to strip
        form.strip(target, folder / asset.name)
        assert _digest(folder / asset.name) == before, "stripping must give the source back"
    _refuses(form, folder)


def _refuses(form: Format, folder: Path) -> None:
    for name, content in (("empty", b""), ("noise", bytes(range(256)) * 4)):
        broken = folder / f"{name}{form.suffixes[0]}"
        broken.write_bytes(content)
        try:
            form.load(broken)
        except InputError:
            continue
        raise AssertionError("a damaged file must be refused with InputError")


def _animation(name: str, shapes: Sequence[str], *, seed: int) -> LineAnimation:
    random = np.random.default_rng(seed)
    times_s = np.concatenate([[0.0], np.sort(random.uniform(0.01, 1.99, 30)), [2.0]])
    weights = random.uniform(0, 1, (len(times_s), len(shapes)))
    return LineAnimation(name, "en", CurveSet(times_s, tuple(shapes), weights), 2.0)


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def check_check(check: Check) -> None:
    """A check says what it is: a permanent id, its subject, and why it matters.

    One of deliveries also says what it may find, by which thresholds, and where these come from.
    """
    assert check.id == check.id.lower().strip(), "an id is lower case"
    known = {subject for subjects in registry.SUBJECTS.values() for subject in subjects}
    assert check.subject in known, f"a check judges one of {sorted(known)}"
    assert len(check.rationale) > 20, "a check must say why it matters"
    if check.subject in registry.SUBJECTS[registry.DELIVERY_CHECKS]:
        judge = cast(DeliveryCheck, check)
        assert judge.codes, "a check must say what it may find"
        for code, entry in judge.codes.items():
            assert re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", code), "words-with-hyphens"
            for text in (entry.meaning, entry.action):
                assert text.endswith("."), "meaning and action are sentences"
        assert len(judge.source) > 10, "a check must say where its thresholds come from"
        assert all(spec.meaning for spec in judge.limits.values()), "a limit must say what it is"
