"""Reading characters from USD."""

from __future__ import annotations

from pathlib import Path

import pytest
from pxr import Usd, UsdGeom, UsdSkel

from animeme.errors import InputError
from support.usd_kit import (
    FORMAT,
    SHAPES,
    add_mesh,
    add_skeleton,
    assert_played,
    hero,
    line,
    new_stage,
    write,
)


def test_load_tells_meshes_shapes_and_rest(tmp_path: Path) -> None:
    path = hero(tmp_path / "hero.usda", old=["browUp", "jawOpen"], weights=[0.25, 0.5])
    character = FORMAT.load(path)
    (mesh,) = character.meshes
    assert (mesh.path, mesh.name, mesh.shapes) == ("/hero/face", "face", tuple(SHAPES))
    assert mesh.rest == (0.0, 0.0, 0.0)
    assert character.animations == ("walk",)
    assert (character.source, character.format) == (path, "usd")


def test_an_old_face_animation_is_no_rest_pose(tmp_path: Path) -> None:
    """USD has none: a smile that the asset came with must not keep every closure open."""
    old = {10.0: [0.5], 20.0: [1.0]}
    character = FORMAT.load(hero(tmp_path / "hero.usda", old=["browUp"], weights=old))
    assert set(character.rest_weights().values()) == {0.0}


def test_numbered_copies_are_one_shape(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "hero.usda")
    add_skeleton(stage, "/hero/rig")
    add_mesh(stage, "/hero/face", "/hero/rig", ["jawOpen", "viseme1", "viseme2"])
    add_mesh(stage, "/hero/teeth", "/hero/rig", ["jawOpen2"])
    stage.Save()
    assert FORMAT.load(tmp_path / "hero.usda").shapes == ("jawOpen", "viseme1", "viseme2")


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("damaged.usda", b"#usda 1.0\n( garbage"),
        ("damaged.usdc", b"PXR-USDC" + bytes(100)),
        ("damaged.usdz", b"PK\3\4 and no more"),
        ("empty.usd", b""),
        ("song.usdc", b"RIFF....WAVE"),
    ],
)
def test_damaged_files_are_refused(
    tmp_path: Path, name: str, content: bytes, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError) as caught:
        FORMAT.load(tmp_path / name)
    assert caught.value.code == "asset-unreadable"
    assert name in caught.value.place
    assert capfd.readouterr() == ("", "")


def test_truncated_crate_is_refused(tmp_path: Path) -> None:
    path = hero(tmp_path / "hero.usdc")
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(InputError, match="asset-unreadable"):
        FORMAT.load(path)


@pytest.mark.parametrize("missing", ["none.usda", "."])
def test_what_is_no_file_is_refused(tmp_path: Path, missing: str) -> None:
    with pytest.raises(InputError, match="asset-unreadable"):
        FORMAT.load(tmp_path / missing)


def test_without_blendshapes_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="asset-no-blendshapes"):
        FORMAT.load(hero(tmp_path / "hero.usda", shapes=[]))


def test_missing_parts_are_named(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "hero.usda")
    stage.GetPrimAtPath("/hero").GetPayloads().AddPayload("./geometry.usdc")
    stage.Save()
    with pytest.raises(InputError, match=r"missing: .*geometry\.usdc.*asset-no-blendshapes"):
        FORMAT.load(tmp_path / "hero.usda")


def test_without_skeleton_refused(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "hero.usda")
    add_mesh(stage, "/hero/face", "", SHAPES)
    stage.Save()
    with pytest.raises(InputError, match=r"/hero/face .*asset-no-skeleton"):
        FORMAT.load(tmp_path / "hero.usda")


def test_instanced_skeleton_refused(tmp_path: Path) -> None:
    hero(tmp_path / "hero.usda")
    stage = Usd.Stage.CreateNew(str(tmp_path / "crowd.usda"))
    extra = stage.DefinePrim("/crowd/extra")
    extra.GetReferences().AddReference("./hero.usda")
    extra.SetInstanceable(True)
    stage.Save()
    with pytest.raises(InputError, match=r"/crowd/extra.*asset-instanced") as caught:
        FORMAT.load(tmp_path / "crowd.usda")
    assert "instanceable = false" in caught.value.action


def test_instanced_mesh_with_a_skeleton_outside_is_driven(tmp_path: Path) -> None:
    stage = Usd.Stage.CreateNew(str(tmp_path / "head.usda"))
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/head").GetPrim())
    add_mesh(stage, "/head/face", "", SHAPES)
    stage.Save()
    stage = new_stage(tmp_path / "hero.usda")
    add_skeleton(stage, "/hero/rig")
    UsdSkel.BindingAPI.Apply(stage.GetPrimAtPath("/hero")).CreateSkeletonRel().SetTargets(
        ["/hero/rig"]
    )
    head = stage.DefinePrim("/hero/head", "Xform")
    head.GetReferences().AddReference("./head.usda")
    head.SetInstanceable(True)
    stage.Save()
    spoken = line("hello", SHAPES)
    _, out = write(tmp_path / "hero.usda", tmp_path / "out" / "hero.usdc", spoken)
    assert_played(out, "/hero/head/face", spoken.curves)
