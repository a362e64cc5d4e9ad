"""Profiles as documents: small files over others, both sides at once, errors with their place."""

from __future__ import annotations

import json
import random
import tomllib
from pathlib import Path

import pytest

from animeme import documents
from animeme.errors import InputError
from animeme.rig import Corrective, Drive, Total
from animeme_stages.retarget.profile_files import (
    arkit_controls,
    profile_names,
    read_profile,
    shipped_profile,
)
from animeme_stages.retarget.profiles import bind
from support.patience import patience
from support.rigs import character
from support.schemas import validate

HEAD = 'schema = "animeme.rig/2"\nname = "mine"\n'
PROFILES = Path(__file__).parents[1] / "stages" / "animeme_stages" / "retarget" / "profiles"


def saved(folder: Path, text: str, name: str = "mine.toml") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("name", profile_names())
def test_shipped_profiles_keep_to_the_schema_and_to_their_names(name: str) -> None:
    data = tomllib.loads((PROFILES / f"{name}.toml").read_text(encoding="utf-8"))
    validate("rig", data)
    assert data["name"] == name
    assert data["family"]
    assert shipped_profile(name).shapes


def test_a_small_file_changes_what_it_says_and_no_more(tmp_path: Path) -> None:
    text = HEAD + (
        'extends = "arkit"\n[controls]\n'
        'jawOpen = [{ shape = "Gape", gain = 1.2 }]\ntongueOut = []\n'
        '[limits]\n"mouthSmile*" = [0, 0.6]\n[ceilings]\nmouthClose = "Gape"\n'
        "[fallbacks]\nmouthFunnel = []\n"
    )
    mine, arkit = read_profile(saved(tmp_path, text)), shipped_profile("arkit")
    assert mine.name == "mine"
    changed = {"jawOpen": (Drive("Gape", 1.2),)}
    expected = {**arkit.drives, **changed}
    del expected["tongueOut"]
    assert mine.drives == expected
    assert mine.limits == {"mouthSmileLeft": (0.0, 0.6), "mouthSmileRight": (0.0, 0.6)}
    assert mine.ceilings == {"mouthClose": "Gape"}
    gone = {"mouthFunnel", "jawOpen"}  # nothing moves jawOpen any more
    assert mine.fallbacks == {s: d for s, d in arkit.fallbacks.items() if s not in gone}
    assert mine.detect_at == arkit.detect_at


def test_a_file_may_extend_another_beside_it(tmp_path: Path) -> None:
    (tmp_path / "shared").mkdir()
    saved(tmp_path / "shared", HEAD + 'extends = "oculus"\n[limits]\nviseme_aa = [0, 0.8]\n')
    path = saved(tmp_path, HEAD + 'extends = "shared/mine.toml"\nrest = "pause"\n', "top.toml")
    mine = read_profile(path)
    assert mine.limits == {"viseme_aa": (0.0, 0.8)}
    assert mine.rest == "pause"
    assert "viseme_sil" not in mine.aliases
    assert mine.poses == shipped_profile("oculus").poses


def test_a_star_stands_for_either_side(tmp_path: Path) -> None:
    text = HEAD + (
        '[controls]\n"mouthSmile*" = [{ shape = "grin_*" }]\nmouthPucker = [{ shape = "ring_*" }]\n'
        'jawOpen = [{ shape = "jaw" }]\n[fallbacks]\n'
        '"grin_*" = [{ shape = "wide_*", gain = 0.5 }]\n'
        '[aliases]\n"grin_*" = ["smirk_*"]\n[correctives]\nboth = { of = ["grin_Left", "jaw"] }\n'
        '[[totals]]\nshapes = ["grin_*", "jaw"]\n'
    )
    text = text.replace('["grin_*", "jaw"]', '["grin_Left", "grin_Right", "jaw"]')
    mine = read_profile(saved(tmp_path, text))
    assert mine.drives["mouthSmileRight"] == (Drive("grin_Right"),)
    assert mine.drives["mouthPucker"] == (Drive("ring_Left"), Drive("ring_Right"))
    assert mine.fallbacks["grin_Left"] == (Drive("wide_Left", 0.5),)
    assert mine.aliases["grin_Left"] == ("smirk_Left",)
    assert mine.correctives == {"both": Corrective(("grin_Left", "jaw"))}
    assert mine.totals == (Total(("grin_Left", "grin_Right", "jaw")),)
    assert bind(mine, character(["SmirkL", "jaw"])).mapped["grin_Left"] == "SmirkL"


def test_a_pose_is_told_for_both_sides_at_once(tmp_path: Path) -> None:
    text = HEAD + "[poses]\nee = { mouthSmile = 0.3, mouthStretchLeft = 0.1, jawOpen = 0.2 }\n"
    assert read_profile(saved(tmp_path, text)).poses["ee"] == {
        "mouthSmileLeft": 0.3,
        "mouthSmileRight": 0.3,
        "mouthStretchLeft": 0.1,
        "jawOpen": 0.2,
    }


def test_documents_of_version_1_are_read(tmp_path: Path) -> None:
    old = 'schema = "animeme.rig/1"\nname = "old"\n[controls]\njawOpen = [{ shape = "a" }]\n'
    path = saved(tmp_path, old)
    assert documents.read("rig", path)["schema"] == "animeme.rig/2"
    assert read_profile(path).drives == {"jawOpen": (Drive("a"),)}
    assert read_profile(saved(tmp_path, old.replace("/1", "/2"))) == read_profile(path)


JAW = '[controls]\njawOpen = [{ shape = "jaw" }]\n'
BAD = {
    "unknown base": ('extends = "arkti"\n', ("extends (line 3)", "Did you mean 'arkit'?")),
    "base file that is not there": ('extends = "no.toml"\n', ("no.toml", "no such file")),
    "itself": ('extends = "mine.toml"\n', ("extends (line 3)", "extends this file in turn")),
    "misspelt table": ("[control]\n", ("control (line 3)", "Did you mean 'controls'?")),
    "misspelt member": (
        '[controls]\na = [{ shape = "x" }]\njawOpen = [\n  { shape = "jaw", gian = 2 },\n]\n',
        ("controls.jawOpen.0.gian (line 5)", "Did you mean 'gain'?"),
    ),
    "limits of a stranger": (
        JAW + "[limits]\n\njwa = [0, 1]\n",
        ("limits.jwa (line 7)", "nothing drives: jwa", "Did you mean 'jaw'?"),
    ),
    "ceiling over a stranger": (
        JAW + '[ceilings]\njaw = "chin"\n', ("ceilings.jaw (line 6)", "nothing drives: chin")
    ),
    "limits upside down": (JAW + "[limits]\njaw = [1, 0]\n", ("limits.jaw (line 6)", "low above")),
    "total of strangers": (
        JAW + '[[totals]]\nshapes = ["jaw", "chin"]\n', ("totals (line 5)", "chin")
    ),
    "corrective of a stranger": (
        JAW + '[correctives]\nfix = { of = ["jaw", "chin"] }\n',
        ("correctives.fix (line 6)", "chin"),
    ),
    "corrective that is driven": (
        JAW + '[correctives]\njaw = { of = ["jaw"] }\n', ("correctives.jaw (line 6)", "as well")
    ),
    "pose of no control": (
        "[poses]\naa = { jawOpne = 1 }\n",
        ("poses.aa (line 4)", "no control of ARKit's", "Did you mean 'jawOpen'?"),
    ),
    "nothing at all": ("", ("no control drives any shape",)),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_errors_tell_the_place_and_near_names(case: str, tmp_path: Path) -> None:
    text, words = BAD[case]
    path = saved(tmp_path, HEAD + text)
    with pytest.raises(InputError) as caught:
        read_profile(path)
    message = str(caught.value)
    assert str(path.parent) in message
    for word in words:
        assert word in message

    mended = saved(tmp_path, HEAD + JAW)
    assert read_profile(mended).shapes == ("jaw",)


def test_circles_of_files_are_refused(tmp_path: Path) -> None:
    saved(tmp_path, HEAD + 'extends = "b.toml"\n', "a.toml")
    saved(tmp_path, HEAD + 'extends = "a.toml"\n', "b.toml")
    with pytest.raises(InputError, match="in turn"):
        read_profile(tmp_path / "a.toml")


def test_json_documents_are_as_good(tmp_path: Path) -> None:
    data = {"schema": "animeme.rig/2", "name": "j", "extends": "vrm1", "limits": {"aa": [0, 0.5]}}
    assert read_profile(saved(tmp_path, json.dumps(data), "j.json")).limits == {"aa": (0.0, 0.5)}


# Fuzz: damaged profiles are read, or refused with their place; quickly, whatever is in them.

SEED = 29
VALUES = (
    "nan", "inf", "-1e308", "1e999", "0", "-1", '""', '"*"', '"arkit"', '"mine.toml"', '"\\u0000"',
    '"../x.toml"', '"/"', "[]", "{}", "[[]]", "true", "1979-05-27", '"' + "*" * 400 + '"',
    "[" * 40 + "]" * 40, '[{ shape = "jawOpen", gain = 1e308 }]', '{ jawOpen = 1e308 }',
    '{ of = [] }',
)  # fmt: skip
TABLES = ("controls", "poses", "limits", "a.b", "[totals]")
SOURCES = tuple(sorted(p.read_text(encoding="utf-8") for p in PROFILES.glob("*.toml")))
LINES = tuple(dict.fromkeys(line for text in SOURCES for line in text.split("\n")))


def mutated(chance: random.Random) -> bytes:
    text = chance.choice(SOURCES)
    if chance.random() < 0.3:
        text = text.replace("\n[", f'\nextends = "{chance.choice(profile_names())}"\n[', 1)
    lines = text.split("\n")
    for _ in range(chance.choice((1, 1, 2, 5, 20))):
        at = chance.randrange(len(lines))
        kind = chance.randrange(7)
        key, equals, _ = lines[at].partition(" = ")
        if kind == 0 and equals:
            lines[at] = f"{key} = {chance.choice(VALUES)}"
        elif kind == 1:
            lines.insert(at, chance.choice(LINES))
        elif kind == 2:
            del lines[at]
            lines = lines or [""]
        elif kind == 3 and equals:
            lines[at] = lines[at].replace(chance.choice(["L", "o", "w", '"', "0"]), "x*", 1)
        elif kind == 4:
            lines[at] = lines[at] * chance.choice((2, 30))
        elif kind == 5:
            lines.insert(
                at, f"[{chance.choice(('controls', 'poses', 'limits', 'a.b', '[totals]'))}]"
            )
        else:
            words = lines[at].split(" ")
            chance.shuffle(words)
            lines[at] = " ".join(words)
    data = bytearray("\n".join(lines).encode())
    if chance.random() < 0.2 and data:
        data[chance.randrange(len(data))] = chance.randrange(256)
    return bytes(data)


def use(path: Path) -> str:
    """What became of a file: "read", or the code of its refusal."""
    try:
        profile = read_profile(path)
    except InputError as error:
        told = str(error)
        if path.name not in told or len(told) > 100_000:
            pytest.fail(f"tells too little or too much: {told[:500]}")
        return error.code
    hero = character([*arkit_controls(), "mouthSmile", "jaw", "x"], ["aa", "jawOpen"])
    assert 0.0 <= bind(profile, hero).coverage <= 1.0
    return "read"


def damage(folder: Path, count: int, seed: str) -> set[str]:
    chance = random.Random(seed)
    outcomes = set()
    for _ in range(count):
        (folder / "mine.toml").write_bytes(mutated(chance))
        with patience():
            outcomes.add(use(folder / "mine.toml"))
    return outcomes


EXPECTED = {"read", "document-invalid", "document-unreadable"}


def test_damaged_profiles_are_read_or_refused(tmp_path: Path) -> None:
    assert damage(tmp_path, 200, f"{SEED}") >= EXPECTED


@pytest.mark.slow
@pytest.mark.parametrize("part", range(4))
def test_many_damaged_profiles_are_read_or_refused(part: int, tmp_path: Path) -> None:
    outcomes = damage(tmp_path, 1250, f"slow-{SEED}-{part}")
    assert outcomes >= {*EXPECTED, "document-kind"}
    assert [path.name for path in tmp_path.iterdir()] == ["mine.toml"]
