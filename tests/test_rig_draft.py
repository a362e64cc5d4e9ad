"""Drafts of profiles: sound documents of any names, refused until completed."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from animeme import documents
from animeme.errors import InputError
from animeme_stages.retarget.draft import draft_profile
from animeme_stages.retarget.profile_files import read_profile
from animeme_stages.retarget.profiles import bind
from support.rigs import character

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
@settings(deadline=None, derandomize=True, max_examples=60)
def test_a_draft_of_any_names_is_toml(names: list[str], name: str) -> None:
    data = tomllib.loads(draft_profile(character(names), name))
    assert data["schema"] == "animeme.rig/2"
    assert data["name"] == name
    documents.type_of("rig").model_validate(data)


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


DRAFTED = {
    "Mund_offen": "jawOpen",
    "bouche_ouverte": "jawOpen",
    "ОткрытьРот": "jawOpen",
    "口開く": "jawOpen",
    "Kussmund": "mouthPucker",
    "BocaCerrada": "mouthClose",
    "sonrisa_L": "mouthSmileLeft",
    "Sourire_droite": "mouthSmileRight",
    "笑い": "mouthSmileLeft",
    "jawOpn": "jawOpen",
    "mouth_funel": "mouthFunnel",
}


@pytest.mark.parametrize("shape", DRAFTED)
def test_names_are_understood_in_many_languages_and_with_slips(shape: str) -> None:
    controls = tomllib.loads(draft_profile(character([shape]), "x"))["controls"]
    assert shape in [entry["shape"] for entry in controls[DRAFTED[shape]]]


@pytest.mark.parametrize("shape", ["eyeClose_L", "まばたき", "Augenlid_zu", "cejas_arriba"])
def test_what_is_not_the_mouth_is_left_to_a_person(shape: str) -> None:
    text = draft_profile(character([shape, "jaw"]), "x")
    assert shape not in str(tomllib.loads(text)["controls"])
    assert f'#   "{shape}"' in text
