"""`animeme validate`: break one thing, and exactly that is found; the sound delivery passes."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from animeme import registry
from animeme.errors import InputError, JobError, PluginError
from animeme.findings import Severity
from animeme.validation import delivery_checks, validate
from support.breaks import PROP
from support.deliveries import (
    Json,
    codes,
    edited,
    shapes,
    skipped,
    with_curves,
)
from support.gltf_build import face, glb
from support.good_delivery import Good
from support.jobs import SAMPLE, animeme, digests


@pytest.fixture
def sound(tiny: Good) -> Path:
    return tiny.folder


SCHEMA = 'schema = "animeme.check-profile/1"\n'


def profile(folder: Path, text: str) -> str:
    path = folder / "own.toml"
    path.write_text(f'{SCHEMA}extends = "delivery"\n{text}', encoding="utf-8")
    return str(path)


def test_the_sound_delivery_passes_everything(sound: Path) -> None:
    before = digests(sound.parent)
    report = validate(
        [sound],
        dialogue=sound.parent / "dialogue",
        against=sound.parent / "hero.glb",
        fail_on=Severity.INFO,
    )
    assert [str(finding) for finding in report.all_findings] == []
    assert report.exit_code == 0
    assert {file.status for file in report.files} == {"ok"}
    lines = {line for file in report.files for _, line in file.lines}
    assert lines == {"en/boat", "en/five", "de/boat", "de/five"}
    assert digests(sound.parent) == before
    # What it could not judge is said: nobody gave a frame rate.
    assert "frame-rate" in skipped(report)


@pytest.mark.parametrize(
    ("name", "content", "code"),
    [
        ("hero.glb", b"glTF\x02\0\0\0\xff\0\0\0", "asset-unreadable"),
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
    shutil.copy(sound / "en" / "hero.glb", tmp_path)
    report = validate([tmp_path])
    assert report.all_findings == ()
    assert [Path(entry.file).name for entry in report.skipped if entry.check == "readable"] == [
        "prop.glb"
    ]


def test_an_unknown_rig(tmp_path: Path) -> None:
    assert codes(SAMPLE / "crab.glb") == {"rig-unknown"}
    assert codes(SAMPLE / "crab.glb", rig=str(SAMPLE / "crab.rig.toml")) == set()


def test_languages_and_lines(sound: Path, tmp_path: Path) -> None:
    here = tmp_path / "delivery"
    for language in ("en", "de"):
        (here / language).mkdir(parents=True)
        shutil.copy(sound / language / "hero.glb", here / language)
    assert codes(here) == set()
    shutil.copy(sound / "en" / "hero.glb", here / "de" / "bob.glb")
    assert codes(here) == {"language-wrong"}
    (here / "de" / "bob.glb").unlink()

    def other(document: Json, _: bytearray) -> None:
        document["animations"][-1]["name"] = "moon"
        document["animations"][-1]["extras"]["animeme"] |= {"line": "moon", "language": "de"}

    edited(sound / "de" / "hero.glb", here / "de" / "hero.glb", other)
    assert codes(here) == {"language-lacks-line"}
    quick = profile(
        tmp_path, _without("sync", "articulation", "bilabials", "labiodentals", "vowels")
    )
    found = codes(here, dialogue=sound.parent / "dialogue", profile=quick)
    assert found == {"language-lacks-line", "line-missing", "line-surplus"}
    mapped = quick_lines(tmp_path, "[lines]\nmoon = 'de/five'")
    assert codes(here, dialogue=sound.parent / "dialogue", profile=mapped) == set()


def quick_lines(folder: Path, text: str) -> str:
    without = _without("sync", "articulation", "bilabials", "labiodentals", "vowels")
    return profile(folder, f"{without}\n{text}")


def _without(*names: str) -> str:
    return "[exclude]\n" + "\n".join(f'{name} = "not what is tested"' for name in names)


def test_a_check_that_fails_fails_no_asset(sound: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: Any) -> Any:
        raise ZeroDivisionError("by nothing")

    monkeypatch.setattr(delivery_checks()["file-size"], "run", broken, raising=False)
    report = validate([sound / "en" / "hero.glb"])
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
    for asset in (SAMPLE / "ada.usdc", sound / "en" / "hero.glb"):
        shutil.copy(asset, tmp_path)
    report = validate([tmp_path])
    (finding,) = report.all_findings
    assert (finding.code, finding.ours, Path(finding.file).name) == (
        "reader-failed", True, "ada.usdc",
    )  # fmt: skip
    assert report.exit_code == 0


def test_profiles_say_what_is_wrong_with_them(tmp_path: Path, sound: Path) -> None:
    asset = sound / "en" / "hero.glb"
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
    assert codes(SAMPLE / "ada.usdc", profile="usd") == set()


def test_paths_that_cannot_be_used(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="does not exist"):
        validate([tmp_path / "none.glb"])
    with pytest.raises(InputError, match="has no asset"):
        validate([tmp_path])


def test_the_command(sound: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asset = with_curves(
        sound / "en" / "hero.glb",
        tmp_path / "hero.glb",
        shapes(mouthShrugUpper={0.0: 0.0, 0.8: 1.4, 1.6: 0.0}),
        source=sound.parent / "hero.glb",
    )
    ran = animeme(capsys, "validate", asset, "--json", "--fail-on", "warning")
    assert ran.code == 1
    ran.says("weight-out-of-range", "mouthShrugUpper", "1 warnings")
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
