"""Numbered copies of a shape: what exporters made of one name is one shape again."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from animeme.rig import Character, MeshShapes, canonical_names

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
