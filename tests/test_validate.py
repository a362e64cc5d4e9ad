"""`animeme validate`: break one thing, and exactly that is found; the sound delivery passes."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from animeme import registry
from animeme.curves import CurveSet
from animeme.errors import InputError, JobError, PluginError
from animeme.findings import Severity
from animeme.validation import delivery_checks, validate
from support.deliveries import (
    Curves,
    Json,
    codes,
    edited,
    make_delivery,
    moved,
    opening,
    put_float,
    shapes,
    skipped,
    with_curves,
)
from support.gltf_build import face, glb
from support.jobs import SAMPLE, animeme, digests


@pytest.fixture(scope="session")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_delivery(tmp_path_factory.mktemp("delivery") / "job")


SCHEMA = 'schema = "animeme.check-profile/1"\n'


def profile(folder: Path, text: str) -> str:
    path = folder / "own.toml"
    path.write_text(f'{SCHEMA}extends = "delivery"\n{text}', encoding="utf-8")
    return str(path)


def test_the_sound_delivery_passes_everything(sound: Path) -> None:
    before = digests(sound.parent)
    report = validate(
        [sound], dialogue=sound.parent / "dialogue", against=sound.parent, fail_on=Severity.INFO
    )
    assert [str(finding) for finding in report.all_findings] == []
    assert report.exit_code == 0
    assert {file.status for file in report.files} == {"ok"}
    assert {line for file in report.files for _, line in file.lines} == {"en/boat", "de/boat"}
    assert digests(sound.parent) == before
    # What it could not judge is said: nobody gave a frame rate.
    assert "frame-rate" in skipped(report)


PROP = glb(face(meshes=[{"primitives": [{"attributes": {}}]}]))
SLOW = {0.0: 0.0, 0.8: 0.4, 1.6: 0.0}
CURVES: dict[str, Curves] = {
    "weight-out-of-range": shapes(cheekPuff={0.0: 0.0, 0.8: 1.4, 1.6: 0.0}),
    "curve-stuck": shapes(cheekPuff={0.0: 0.5}),
    "curves-alike": shapes(cheekPuff=SLOW, browInnerUp=SLOW),
    "sides-differ": shapes(mouthDimpleLeft=SLOW),
    "shapes-conflict": shapes(mouthClose={0.0: 0.0, 0.8: 0.9, 1.6: 0.0}),
    "shape-too-fast": shapes(cheekPuff={0.0: 0.0, 0.5: 0.0, 0.51: 0.9, 1.6: 0.0}),
    "shape-pops": shapes(cheekPuff={0.0: 0.0, 0.5: 0.0, 0.533: 0.45, 0.566: 0.0}),
    "animation-still": lambda c: CurveSet(c.times_s, c.names, c.weights * 0),
    "keys-dense": lambda c: CurveSet(
        np.arange(0, c.duration_s, 0.004), c.names, c.sample(np.arange(0, c.duration_s, 0.004))
    ),
    "times-late": lambda c: CurveSet(c.times_s + 0.4, c.names, c.weights),
}


@pytest.mark.parametrize("suffix", [".glb", ".usdc"])
@pytest.mark.parametrize("code", CURVES)
def test_damaged_curves(sound: Path, tmp_path: Path, code: str, suffix: str) -> None:
    source, target = sound / "en" / f"ada{suffix}", tmp_path / f"ada{suffix}"
    assert codes(with_curves(source, target, CURVES[code])) == {code}
    assert codes(with_curves(source, target, lambda curves: curves)) == set()


def _accessor(document: Json, which: str) -> Json:
    index = document["animations"][-1]["samplers"][0][which]
    accessor: Json = document["accessors"][index]
    return accessor


def _fewer(document: Json, _: bytearray) -> None:
    _accessor(document, "output")["count"] -= 1


def _lost(document: Json, _: bytearray) -> None:
    document["animations"][-1]["channels"][0]["sampler"] = 99


def _twice(document: Json, _: bytearray) -> None:
    document["animations"].append(document["animations"][-1])


def _drop_shapes(document: Json, _: bytearray) -> None:
    for mesh in document["meshes"]:
        names = mesh.get("extras", {}).get("targetNames", [])
        kept = ("jawOpen", "mouthClose", "mouthPucker", "mouthFunnel", "jawForward")
        if names:
            mesh["extras"]["targetNames"] = [n if n in kept else f"{n}Q" for n in names]


STORED: dict[str, Callable[[Json, bytearray], None]] = {
    "weights-not-finite": put_float("output", 3, float("nan")),
    "times-not-increasing": put_float("input", 2, 0.0),
    "times-negative": put_float("input", 0, -0.5),
    "weights-count": _fewer,
    "animation-broken": _lost,
    "animation-name-twice": _twice,
    "rig-incomplete": _drop_shapes,
}


@pytest.mark.parametrize("code", STORED)
def test_damaged_files(sound: Path, tmp_path: Path, code: str) -> None:
    target = edited(sound / "en" / "ada.glb", tmp_path / "ada.glb", STORED[code])
    report = validate([target])
    assert {finding.code for finding in report.all_findings} == {code}
    place = report.all_findings[0].place
    assert place.startswith("/animations/") or code == "rig-incomplete"
    assert codes(edited(sound / "en" / "ada.glb", target, lambda *_: None)) == set()


@pytest.mark.parametrize(
    ("name", "content", "code"),
    [
        ("ada.glb", b"glTF\x02\0\0\0\xff\0\0\0", "asset-unreadable"),
        ("ada.usdc", b"PXR-USDC cut off", "asset-unreadable"),
        (
            "prop.glb",
            glb(face(meshes=[{"primitives": [{"attributes": {}}]}])),
            "asset-no-blendshapes",
        ),
        ("ada.usda", b'#usda 1.0\n(\n  doc = "\xa2" !\n', "asset-unreadable"),
        ("ada.fbx", b"Kaydara FBX Binary", "asset-unusable"),
    ],
)
def test_what_cannot_be_read(tmp_path: Path, name: str, content: bytes, code: str) -> None:
    (tmp_path / name).write_bytes(content)
    report = validate([tmp_path / name])
    assert {finding.code for finding in report.all_findings} == {code}
    assert report.exit_code == 1
    assert "tracks-readable" in skipped(report)


def test_a_prop_in_a_folder_is_passed_over(sound: Path, tmp_path: Path) -> None:
    (tmp_path / "prop.glb").write_bytes(PROP)
    shutil.copy(sound / "en" / "ada.glb", tmp_path)
    report = validate([tmp_path])
    assert report.all_findings == ()
    assert [Path(entry.file).name for entry in report.skipped if entry.check == "readable"] == [
        "prop.glb"
    ]


def test_an_unknown_rig(tmp_path: Path) -> None:
    assert codes(SAMPLE / "crab.glb") == {"rig-unknown"}
    assert codes(SAMPLE / "crab.glb", rig=str(SAMPLE / "crab.rig.toml")) == set()


def test_limits_of_a_profile(sound: Path, tmp_path: Path) -> None:
    asset = sound / "en" / "ada.glb"
    for text, code in (
        ("[limits.file-size]\nmost_mib = 0.1", "file-too-large"),
        ('[limits.file-kind]\nsuffixes = [".vrm"]', "file-kind-refused"),
        ('[limits.rig-shapes]\nrequired = ["jawOpen", "snout"]', "shapes-missing"),
        ('[limits.frame-rate]\nrate = "24"', "keys-off-frames"),
    ):
        assert codes(asset, profile=profile(tmp_path, text)) == {code}
    on_frames = with_curves(asset, tmp_path / "ada.glb", lambda c: _sampled(c, 24.0))
    rate = profile(tmp_path, '[limits.frame-rate]\nrate = "24"')
    assert codes(on_frames, profile=rate) == set()


def _sampled(curves: CurveSet, rate_hz: float) -> CurveSet:
    at_s = np.arange(np.ceil(curves.duration_s * rate_hz) + 1) / rate_hz
    return CurveSet(at_s, curves.names, curves.sample(at_s))


def test_a_source_that_was_changed(sound: Path, tmp_path: Path) -> None:
    def rename(document: Json, _: bytearray) -> None:
        document["nodes"][0]["name"] = "somebody else"

    target = edited(sound / "en" / "ada.glb", tmp_path / "ada.glb", rename)
    assert codes(target, against=SAMPLE / "ada.glb") == {"source-changed"}
    assert codes(target) == set()
    assert codes(sound / "en", against=sound.parent) == set()


def test_languages_and_lines(sound: Path, tmp_path: Path) -> None:
    here = tmp_path / "delivery"
    for language in ("en", "de"):
        (here / language).mkdir(parents=True)
        shutil.copy(sound / language / "ada.glb", here / language)
    assert codes(here) == set()
    shutil.copy(sound / "en" / "ada.glb", here / "de" / "bob.glb")
    assert codes(here) == {"language-wrong"}
    (here / "de" / "bob.glb").unlink()

    def other(document: Json, _: bytearray) -> None:
        document["animations"][-1]["name"] = "moon"
        document["animations"][-1]["extras"]["animeme"] |= {"line": "moon", "language": "de"}

    edited(sound / "de" / "ada.glb", here / "de" / "ada.glb", other)
    assert codes(here) == {"language-lacks-line"}
    quick = profile(
        tmp_path, _without("sync", "articulation", "bilabials", "labiodentals", "vowels")
    )
    found = codes(here, dialogue=sound.parent / "dialogue", profile=quick)
    assert found == {"language-lacks-line", "line-missing", "line-surplus"}
    mapped = quick_lines(tmp_path, "[lines]\nmoon = 'de/boat'")
    assert codes(here, dialogue=sound.parent / "dialogue", profile=mapped) == set()


def quick_lines(folder: Path, text: str) -> str:
    without = _without("sync", "articulation", "bilabials", "labiodentals", "vowels")
    return profile(folder, f"{without}\n{text}")


def _without(*names: str) -> str:
    return "[exclude]\n" + "\n".join(f'{name} = "not what is tested"' for name in names)


@pytest.fixture(scope="session")
def boat(sound: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dialogue of one line."""
    folder = tmp_path_factory.mktemp("boat") / "dialogue"
    (folder / "en").mkdir(parents=True)
    for suffix in (".wav", ".txt"):
        shutil.copy(sound.parent / "dialogue" / "en" / f"boat{suffix}", folder / "en")
    return folder


def _silenced(times_s: Any, jaw: Any) -> Any:
    return np.where(times_s > 1.0, 0.0, jaw)


AGAINST_AUDIO: dict[str, Curves] = {
    "animation-short": lambda c: CurveSet(*_cut(c, 0.6)),
    "animation-long": lambda c: CurveSet(*_cut(c, 1.6)),
    "sync-lag": moved(0.15),
    "sync-unrelated": opening(lambda t, _: np.random.default_rng(0).uniform(0, 1, len(t))),
    "articulation-unrelated": opening(lambda t, _: t / t[-1]),
    "bilabials-open": opening(lambda t, jaw: 0.3 + 0.4 * jaw),
    "delivery-flat": opening(lambda t, jaw: jaw * 0.05),
    "speech-mouth-closed": opening(_silenced),
}


def _cut(curves: CurveSet, factor: float) -> tuple[Any, tuple[str, ...], Any]:
    at_s = np.arange(0.0, curves.duration_s * factor, 1 / 60)
    return at_s, curves.names, curves.sample(at_s)


@pytest.mark.parametrize("code", AGAINST_AUDIO)
def test_against_the_recording(sound: Path, boat: Path, tmp_path: Path, code: str) -> None:
    source = sound / "en" / "ada.glb"
    speech_s = _length_s(boat / "en" / "boat.wav")
    target = with_curves(source, tmp_path / "ada.glb", AGAINST_AUDIO[code], length_s=speech_s)
    assert code in codes(target, dialogue=boat)


def test_vowels_that_do_not_open(sound: Path, boat: Path, tmp_path: Path) -> None:
    phones = json.loads((sound / "alignments" / "en" / "boat.json").read_text())["phones"]
    vowels = [p for p in phones if p["symbol"] in ("AA", "AE", "AH", "AO", "AW", "AY")]
    assert len(vowels) >= 2

    def closed(times_s: Any, _: Any) -> Any:
        inside = [(times_s > v["start_s"] - 0.06) & (times_s < v["end_s"] + 0.06) for v in vowels]
        return np.where(np.any(inside, axis=0), 0.0, 0.4)

    source = sound / "en" / "ada.glb"
    length_s = _length_s(boat / "en" / "boat.wav")
    target = with_curves(source, tmp_path / "ada.glb", opening(closed), length_s=length_s)
    assert "vowels-closed" in codes(target, dialogue=boat)


def test_the_line_itself_passes(sound: Path, boat: Path) -> None:
    assert codes(sound / "en" / "ada.glb", dialogue=boat) == set()


def test_another_take_of_the_recording(sound: Path, boat: Path, tmp_path: Path) -> None:
    source = sound / "en" / "ada.glb"
    target = with_curves(source, tmp_path / "ada.glb", lambda c: c, length_s=1.0)
    assert "recording-changed" in codes(target, dialogue=boat)


def _length_s(path: Path) -> float:
    import soundfile

    return float(soundfile.info(path).duration)


def test_a_check_that_fails_fails_no_asset(sound: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: Any) -> Any:
        raise ZeroDivisionError("by nothing")

    monkeypatch.setattr(delivery_checks()["file-size"], "run", broken, raising=False)
    report = validate([sound / "en" / "ada.glb"])
    (finding,) = report.all_findings
    assert (finding.code, finding.ours) == ("check-failed", True)
    assert "file-size" in finding.message
    assert "ZeroDivisionError" in finding.message
    assert report.files[0].status == "ok"
    assert report.exit_code == 0


def test_a_reader_that_fails_stops_nobody(
    sound: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(path: Path) -> Any:
        raise ZeroDivisionError(path.name)

    form = registry.format_of(Path("a.usdc"))
    monkeypatch.setattr(form, "load", broken, raising=False)
    report = validate([sound / "en"])
    (finding,) = report.all_findings
    assert (finding.code, finding.ours, Path(finding.file).name) == (
        "reader-failed", True, "ada.usdc",
    )  # fmt: skip
    assert report.exit_code == 0


def test_profiles_say_what_is_wrong_with_them(tmp_path: Path, sound: Path) -> None:
    asset = sound / "en" / "ada.glb"
    with pytest.raises(PluginError, match="delivery"):
        validate([asset], profile="delivry")
    text = (
        '[exclude]\nsinc = "we never sync"\n[severities]\nbad = "error"\n[limits.sync]\nlog_s = 1.0'
    )
    with pytest.raises(JobError) as caught:
        validate([asset], profile=profile(tmp_path, text))
    assert [p.path.split(" ")[0] for p in caught.value.problems] == [
        "exclude.sinc", "severities.bad", "limits.sync.log_s",
    ]  # fmt: skip
    with pytest.raises(InputError, match="exclude"):
        validate([asset], profile=profile(tmp_path, '[exclude]\nsync = ""'))
    for name in ("strict", "engine-unity", "engine-unreal"):
        assert codes(asset, profile=name) == set()
    assert codes(sound / "en" / "ada.usdc", profile="usd") == set()


def test_paths_that_cannot_be_used(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="does not exist"):
        validate([tmp_path / "none.glb"])
    with pytest.raises(InputError, match="has no asset"):
        validate([tmp_path])


def test_the_command(sound: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asset = with_curves(
        sound / "en" / "ada.glb", tmp_path / "ada.glb", CURVES["weight-out-of-range"]
    )
    ran = animeme(capsys, "validate", asset, "--json", "--fail-on", "warning")
    assert ran.code == 1
    ran.says("weight-out-of-range", "cheekPuff", "1 warnings")
    report = tmp_path / "report.json"
    report.write_text(ran.out, encoding="utf-8")
    (finding,) = json.loads(ran.out)["files"][0]["findings"]
    assert finding["check"] == "weight-range"
    assert finding["start_s"] == pytest.approx(0.8, abs=0.05)
    again = animeme(capsys, "validate", asset, "--baseline", report, "--fail-on", "warning")
    assert again.code == 0
    assert "1 accepted" in again.out
    assert animeme(capsys, "validate", asset, "--junit", asset).code == 2
    listed = animeme(capsys, "validate", "--list-checks")
    assert all(check in listed.out for check in delivery_checks())
