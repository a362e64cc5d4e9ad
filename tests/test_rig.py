"""Shape names: which are the same, which are not, and what a profile makes of them."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from animeme import documents
from animeme.curves import CurveSet
from animeme.errors import InputError
from animeme.rig import (
    BoundRig,
    Character,
    Drive,
    MeshShapes,
    RigProfile,
    canonical_names,
)
from animeme_stages.retarget.draft import draft_profile
from animeme_stages.retarget.profiles import (
    bind,
    bind_rig,
    detect,
    profile_names,
    read_profile,
    read_rig,
    shipped_profile,
    spelling,
)
from animeme_stages.retarget.retarget import retarget


def character(*meshes: Sequence[str], rest: float = 0.0) -> Character:
    made = (
        MeshShapes(f"/nodes/{i}", f"mesh {i}", tuple(names), (rest,) * len(names))
        for i, names in enumerate(meshes)
    )
    return Character(Path("hero.glb"), "gltf", tuple(made))


# Numbered copies

CANONICAL = {
    "numbered per mesh": (
        [["jawOpen", "smile"], ["jawOpen2", "smile2"], ["jawOpen5"]],
        {"jawOpen2": "jawOpen", "smile2": "smile", "jawOpen5": "jawOpen"},
    ),
    "numbered with a dot": (
        [["Key"], ["Key.001"], ["Key.012"]],
        {"Key.001": "Key", "Key.012": "Key"},
    ),
    "variants of one mesh": ([["viseme", "viseme1", "viseme2"]], {}),
    "variants on every mesh": ([["viseme1", "viseme2"], ["viseme1", "viseme2"]], {}),
    "no bare name anywhere": ([["jawOpen2"], ["jawOpen3"]], {}),
    "copies within a mesh": ([["Key", "Key.001"]], {}),
    "same mesh owns both": ([["jawOpen", "jawOpen2"], ["jawOpen2"]], {}),
    "bare name comes later": ([["jawOpen2"], ["jawOpen"]], {"jawOpen2": "jawOpen"}),
    "two variants beside a bare name": ([["smile"], ["smile1", "smile2"]], {}),
    "only digits": ([["1"], ["2", "12"]], {}),
    "dots and digits": ([["."], [".001", "..2"]], {}),
    "empty": ([[""], ["7"]], {}),
    "two numbers": ([["a1"], ["a1.002"]], {}),
}


@pytest.mark.parametrize("case", CANONICAL)
def test_a_number_is_dropped_only_where_it_marks_a_copy(case: str) -> None:
    meshes, copies = CANONICAL[case]
    expected = {name: copies.get(name, name) for names in meshes for name in names}
    assert canonical_names(meshes) == expected


OWNED = st.sets(st.sampled_from(("a", "a1", "a2", "a.001", "12"))).map(sorted)


@given(st.lists(OWNED, min_size=2, max_size=3))
@settings(deadline=None, derandomize=True, max_examples=200)
def test_folding_joins_no_two_shapes_of_one_mesh(meshes: list[list[str]]) -> None:
    canonical = canonical_names(meshes)
    for names in meshes:
        assert len({canonical[name] for name in names}) == len(names)
    stored = {name for names in meshes for name in names}
    assert set(canonical) == stored
    assert set(canonical.values()) <= stored


def test_a_characters_shapes_are_folded_and_the_first_mesh_gives_the_rest() -> None:
    meshes = (
        MeshShapes("/nodes/1", "head", ("jawOpen", "smile"), (0.25, 0.0)),
        MeshShapes("/nodes/2", "teeth", ("jawOpen2", "bite"), (0.75, 0.5)),
    )
    hero = Character(Path("hero.glb"), "gltf", meshes)
    assert hero.shapes == ("jawOpen", "smile", "bite")
    assert hero.rest_weights() == {"jawOpen": 0.25, "smile": 0.0, "bite": 0.5}


def test_shapes_and_rest_weights_go_together() -> None:
    with pytest.raises(ValueError, match="/nodes/0: 2 shapes but 1 weights"):
        MeshShapes("/nodes/0", "head", ("a", "b"), (0.0,))


# Spelling


@pytest.mark.parametrize(
    "name",
    [
        "mouthSmileLeft",
        "mouthSmile_L",
        "mouthSmileL",
        "MouthSmile_Left",
        "Head.mouthSmileLeft",
        "Head.mouthSmile_L",
        "Armature|mouthSmile_L",
        "ns:mouthSmile_L",
        "mouth_smile_left",
        "mouth smile left",
        "mouth-smile-L",
        "MOUTH_SMILE_LEFT",
        "mouthSmile L",
        # Blender's own way of marking sides, and with it, of marking copies.
        "mouthSmile.L",
        "Head.mouthSmile.L",
        "mouth_smile_l",
    ],
)
def test_one_shape_in_many_spellings(name: str) -> None:
    assert spelling(name) == spelling("mouthSmileLeft")
    assert spelling(name) != spelling("mouthSmileRight")


def test_names_that_only_look_alike_stay_apart() -> None:
    apart = [
        "curl", "cu", "cuLeft", "roll", "rol", "rolLeft", "blur", "blu", "bluRight",
        "lower", "lowe", "all", "al", "CURL", "FUR", "eyeLookUp", "eyeLookUpL", "eyeLookUpR",
        "mouthLeft", "mouthRight", "mouth", "あ", "い", "browDown.L", "eyeBlink.L", "browDown.R",
        "smile.001", "frown.001", "jawOpen", "jaw", "L", "R",
    ]  # fmt: skip
    clashes = [
        (a, b)
        for a, b in combinations(apart, 2)
        if spelling(a) == spelling(b) and a.lower() != b.lower()
    ]
    assert clashes == []


@pytest.mark.parametrize("name", ["curl", "roll", "blur", "lower", "pucker", "all"])
def test_a_word_that_ends_in_l_or_r_has_no_side(name: str) -> None:
    assert spelling(name) == name


def test_names_of_signs_only_are_nobodys() -> None:
    profile = RigProfile("p", {"c": (Drive("!"),)})
    assert bind(profile, character(["?", "…"])).missing == ("!",)


# Binding and detection

SPEECH = (
    "jawOpen", "mouthClose", "mouthFunnel", "mouthPucker", "mouthSmileLeft", "mouthSmileRight",
    "mouthStretchLeft", "mouthStretchRight", "mouthLowerDownLeft", "mouthLowerDownRight",
    "mouthUpperUpLeft", "mouthUpperUpRight", "mouthRollLower", "tongueOut",
)  # fmt: skip


def sided(name: str, left: str, right: str) -> str:
    for side, mark in (("Left", left), ("Right", right)):
        if name.endswith(side):
            return name.removesuffix(side) + mark
    return name


STYLES = {
    "ARKit": list(SPEECH),
    "_L and _R": [sided(name, "_L", "_R") for name in SPEECH],
    "L and R": [sided(name, "L", "R") for name in SPEECH],
    ".L and .R, Blender": [sided(name, ".L", ".R") for name in SPEECH],
    "capitals": [name[0].upper() + name[1:] for name in SPEECH],
    "with a prefix": [f"Head.{name}" for name in SPEECH],
    "_Left and _Right": [sided(name, "_Left", "_Right") for name in SPEECH],
    "snake": ["".join(f"_{c.lower()}" if c.isupper() else c for c in name) for name in SPEECH],
    "snake with _l and _r": [
        "".join(f"_{c.lower()}" if c.isupper() else c for c in sided(name, "_l", "_r"))
        for name in SPEECH
    ],
}


@pytest.mark.parametrize("style", STYLES)
def test_arkit_is_detected_in_every_spelling(style: str) -> None:
    names = STYLES[style]
    bound = detect(character(["eyes", *names]))
    assert bound.profile.name == "arkit"
    assert bound.mapped == dict(zip(SPEECH, names, strict=True))
    assert bound.coverage == pytest.approx(len(SPEECH) / 52)
    for control, own in zip(SPEECH, names, strict=True):
        assert bound.profile.drives[control] == (Drive(own),)


def test_the_exact_name_wins_over_another_spelling() -> None:
    profile = RigProfile("p", {"c": (Drive("jawOpen"),)})
    assert bind(profile, character(["JawOpen", "jawOpen"])).mapped == {"jawOpen": "jawOpen"}
    assert bind(profile, character(["JawOpen", "jaw_open"])).mapped == {"jawOpen": "JawOpen"}


def test_a_prefix_per_mesh_leaves_no_mesh_behind() -> None:
    head = ["headShapes.jawOpen", "headShapes.mouthSmile_L"]
    hero = character(head, ["teethShapes.jawOpen"])
    bound = bind(shipped_profile("arkit"), hero)
    (drive,) = bound.profile.drives["jawOpen"]
    driven = {stored for stored, name in hero.canonical.items() if name == drive.shape}
    assert driven == {"headShapes.jawOpen", "teethShapes.jawOpen"}


def test_what_the_character_lacks_is_missing_and_its_limits_go() -> None:
    profile = RigProfile(
        "p",
        {"a": (Drive("one", 0.5), Drive("two")), "b": (Drive("two"),)},
        {"one": (-1.0, 1.0), "two": (0.0, 0.5)},
        {"one": "two"},
    )
    bound = bind(profile, character(["One"]))
    assert bound.mapped == {"one": "One"}
    assert bound.missing == ("two",)
    assert bound.coverage == 0.5
    assert bound.profile == RigProfile("p", {"a": (Drive("One", 0.5),)}, {"One": (-1.0, 1.0)})


def test_a_profile_without_shapes_covers_nothing() -> None:
    assert BoundRig(RigProfile("p", {}), {}, ()).coverage == 0.0


def test_a_rig_of_no_family_is_an_input_error_that_says_how_to_go_on() -> None:
    with pytest.raises(InputError, match="animeme rig ASSET --draft") as caught:
        detect(character(["scuttle", "pinch"]))
    assert caught.value.code == "rig-unknown"


# What a job says

HEAD = 'schema = "animeme.rig/1"\nname = "x"\n[controls]'
BAD_RIGS = {
    "unknown name": ("arkti", None, "rig-not-found", "Did you mean 'arkit'"),
    "file that is not there": ("my.toml", None, "document-unreadable", "no such file"),
    "broken TOML": ("my.toml", "name = ", "document-unreadable", "Invalid value"),
    "another kind": ("my.toml", 'schema = "animeme.job/1"', "document-kind", "animeme.rig/1"),
    "no control": (
        "my.toml",
        HEAD,
        "document-invalid",
        "no control drives",
    ),
    "stray limits": (
        "my.toml",
        HEAD + '\na = [{shape = "s"}]\n[limits]\nt = [0, 1]',
        "document-invalid",
        "nothing drives: t",
    ),
    "inverted limits": (
        "my.toml",
        HEAD + '\na = [{shape = "s"}]\n[limits]\ns = [1, 0]',
        "document-invalid",
        "low above high: s",
    ),
    "misspelt member": (
        "my.toml",
        HEAD + '\na = [{shape = "s", gian = 1}]',
        "document-invalid",
        "Did you mean 'gain'",
    ),
    "gain not a number": (
        "my.toml",
        HEAD + '\na = [{shape = "s", gain = nan}]',
        "document-invalid",
        "controls.a.0.gain",
    ),
}


@pytest.mark.parametrize("case", BAD_RIGS)
def test_a_bad_rig_is_refused_with_its_reason(case: str, tmp_path: Path) -> None:
    rig, content, code, message = BAD_RIGS[case]
    if content is not None:
        (tmp_path / rig).write_text(content, encoding="utf-8")
    with pytest.raises(InputError, match=message) as caught:
        read_rig(rig, tmp_path)
    assert caught.value.code == code


def test_auto_and_shipped_rigs_need_no_file(tmp_path: Path) -> None:
    assert read_rig("auto", tmp_path) is None
    for name in profile_names():
        profile = read_rig(name, tmp_path)
        assert profile is not None
        assert profile.name == name


def test_a_profile_that_shares_no_shape_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="rig-mismatch"):
        bind_rig("arkit", character(["scuttle"]), tmp_path)


# Retargeting


def bound(
    drives: dict[str, tuple[Drive, ...]],
    limits: dict[str, tuple[float, float]] | None = None,
    ceilings: dict[str, str] | None = None,
) -> BoundRig:
    profile = RigProfile("p", drives, limits or {}, ceilings or {})
    return BoundRig(profile, {shape: shape for shape in profile.shapes}, ())


def controls(**columns: Sequence[float]) -> CurveSet:
    count = len(next(iter(columns.values())))
    return CurveSet(np.arange(count) / 10, tuple(columns), np.array(list(columns.values())).T)


RETARGET: dict[str, tuple[CurveSet, BoundRig, dict[str, float], dict[str, list[float]]]] = {
    "as it is": (controls(a=[0, 0.5]), bound({"a": (Drive("x"),)}), {}, {"x": [0, 0.5]}),
    "gain": (controls(a=[0, 0.5]), bound({"a": (Drive("x", 0.5),)}), {}, {"x": [0, 0.25]}),
    "several shapes": (
        controls(a=[0.5]),
        bound({"a": (Drive("x"), Drive("y", 0.5))}),
        {},
        {"x": [0.5], "y": [0.25]},
    ),
    "sums": (
        controls(a=[0.25], b=[0.5]),
        bound({"a": (Drive("x"),), "b": (Drive("x", 0.5),)}),
        {},
        {"x": [0.5]},
    ),
    "same shape twice": (
        controls(a=[0.25]),
        bound({"a": (Drive("x"), Drive("x", 2.0))}),
        {},
        {"x": [0.75]},
    ),
    "held within [0, 1]": (
        controls(a=[-1, 2]),
        bound({"a": (Drive("x"),)}),
        {},
        {"x": [0, 1]},
    ),
    "own limits": (
        controls(a=[-1, 2]),
        bound({"a": (Drive("x"),)}, {"x": (-0.5, 1.5)}),
        {},
        {"x": [-0.5, 1.5]},
    ),
    "negative gain from rest": (
        controls(a=[0, 0.5]),
        bound({"a": (Drive("x", -1.0),)}),
        {"x": 0.75},
        {"x": [0.75, 0.25]},
    ),
    "rest is added, then limited": (
        controls(a=[0, 1]),
        bound({"a": (Drive("x"),)}),
        {"x": 0.5, "other": 1.0},
        {"x": [0.5, 1.0]},
    ),
    "ceiling": (
        controls(open=[0, 0.25, 1], close=[0.5, 0.5, 0.5]),
        bound({"open": (Drive("o"),), "close": (Drive("c"),)}, None, {"c": "o"}),
        {},
        {"o": [0, 0.25, 1], "c": [0, 0.25, 0.5]},
    ),
    "ceiling of a shape that no control here drives": (
        controls(close=[0.5]),
        bound({"open": (Drive("o"),), "close": (Drive("c"),)}, None, {"c": "o"}),
        {},
        {"c": [0.5]},
    ),
    "control without drive": (
        controls(a=[0.5], tongueOut=[1.0]),
        bound({"a": (Drive("x"),)}),
        {},
        {"x": [0.5]},
    ),
    "nothing driven": (controls(a=[0.5, 1]), bound({"b": (Drive("x"),)}), {}, {}),
}


@pytest.mark.parametrize("case", RETARGET)
def test_controls_become_shapes(case: str) -> None:
    curves, rig, rest, expected = RETARGET[case]
    shapes = retarget(curves, rig, rest)
    assert shapes.times_s.tolist() == curves.times_s.tolist()
    assert {name: shapes.curve(name).tolist() for name in shapes.names} == expected


# Drafts

ODD_NAMES = {
    "plain": ["Mouth_Open", "lipsPucker", "smile", "scuttle"],
    "quotes and backslashes": ['open "wide"', "it's\\open", "a'''b\"\"\"c open"],
    "line ends": ["open\nmouth", "open\r", "x\u2028y"],
    "line end in a name not placed": ["scuttle\nname = 'evil'", "jaw"],
    "control characters": ["open\0", "open\x1b", "jaw\x7f", "tab\topen"],
    "control characters in a name not placed": ["scuttle\x7f", "jaw"],
    "emoji and scripts": ["open😀", "開く", "فم open", "e\u0301 open"],
    "TOML in a name": ["open]", "[controls]", "open = 1", "# open", "open}, {"],
    "duplicates by case": ["jawOpen", "JawOpen", "jaw_open", "JAW OPEN"],
    "empty": ["", "jaw"],
    "very long": ["open_" + "x" * 10_000],
    "open and close": ["open", "close"],
}  # fmt: skip


@pytest.mark.parametrize("case", ODD_NAMES)
def test_a_draft_is_a_rig_document_that_names_every_shape(case: str, tmp_path: Path) -> None:
    hero = character(ODD_NAMES[case])
    path = tmp_path / "draft.toml"
    text = draft_profile(hero, 'the "odd" one\n')
    path.write_bytes(text.encode("utf-8"))
    data = documents.read("rig", path)
    placed = {entry["shape"] for entries in data["controls"].values() for entry in entries}
    assert data["name"] == 'the "odd" one\n'
    assert placed
    assert placed <= set(hero.shapes)
    comments = [line for line in text.splitlines() if line.startswith("#   ")]
    assert len(comments) == len(set(hero.shapes) - placed)
    assert bind(read_profile(path), hero).missing == ()


NAMES = st.lists(
    st.one_of(
        st.text(max_size=6),
        st.sampled_from(("open", "shut", "w", "O", "smileL", '"', "\\", "#", "\n")),
    ),
    unique=True,
    max_size=6,
)


@given(NAMES, st.text(max_size=5))
@settings(deadline=None, derandomize=True, max_examples=150)
def test_a_draft_of_any_names_is_toml(names: list[str], name: str) -> None:
    data = tomllib.loads(draft_profile(character(names), name))
    assert data["schema"] == "animeme.rig/1"
    assert data["name"] == name
    documents.KINDS["rig"].model_validate(data)


def test_half_an_emoji_as_json_may_hold_it_does_not_break_a_draft() -> None:
    text = draft_profile(character(["open\ud83d", "jaw"]), "crab")
    assert tomllib.loads(text.encode("utf-8").decode("utf-8"))["controls"]["jawOpen"]


def test_a_draft_that_placed_nothing_is_refused_until_completed(tmp_path: Path) -> None:
    path = tmp_path / "draft.toml"
    path.write_text(draft_profile(character(["scuttle"]), "crab"), encoding="utf-8")
    assert documents.read("rig", path)["controls"] == {}
    with pytest.raises(InputError, match="no control drives any shape"):
        read_profile(path)


def test_closing_is_held_under_opening_where_both_are_clear() -> None:
    text = draft_profile(character(["mouth_open", "mouth_shut", "scuttle"]), "crab")
    assert tomllib.loads(text)["ceilings"] == {"mouth_shut": "mouth_open"}
    assert '#   "scuttle"' in text
