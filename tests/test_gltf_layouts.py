"""Layouts of animation alone: small GLBs, and .vrma for avatars."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from animeme.contracts import LineAnimation
from animeme.curves import CurveSet
from animeme.errors import InputError
from animeme_stages.write.gltf_clip import AnimationFile
from animeme_stages.write.usd import UsdFormat
from support.gltf_build import BIN_KIND, TRIANGLE, Json, document_of, face, glb, mesh, split_glb
from support.gltf_kit import FORMAT, face_glb, line, saved, speech
from support.jobs import SAMPLE, Capture, run_inline, small_job
from support.judges import khronos_findings, three_weights, vrma_weights

AT_S = np.linspace(0, 3, 13)


def written(layout: str, source: Path, target: Path, curves: CurveSet) -> Path:
    character = FORMAT.load(source)
    form = FORMAT.for_layout(layout, character)
    target = target.with_suffix(form.output_suffix(source))
    before = source.read_bytes()
    assert form.write(character, [line(curves)], target) == (target,)
    assert source.read_bytes() == before
    assert form.harm(character, target) == []
    found = form.read_animations(target)["hello"]
    columns = [found.names.index(name) for name in curves.names]
    np.testing.assert_allclose(found.sample(AT_S)[:, columns], curves.sample(AT_S), atol=1e-3)
    severities = {severity for severity, _ in khronos_findings(target)[target]}
    assert severities <= {2}, "the Khronos validator has errors or warnings"
    return target


# Animation-only GLBs


def test_a_clip_has_the_driven_nodes_and_no_more(tmp_path: Path) -> None:
    document = face(
        nodes=[
            {"mesh": 1, "name": "hat"},
            {"mesh": 0, "name": "face", "weights": [0.25, 0]},
            {"name": "bone"},
        ],
        meshes=[mesh(2, ["jawOpen", "blink"]), mesh(1, ["tilt"])],
        scenes=[{"nodes": [0, 1, 2]}],
    )
    target = written(
        "animation-only", face_glb(tmp_path, document), tmp_path / "clip", speech(["blink"])
    )
    root = document_of(target)
    assert [node["name"] for node in root["nodes"]] == ["face"]
    assert root["meshes"][0]["extras"]["targetNames"] == ["jawOpen", "blink"]
    assert target.stat().st_size < 1500


@pytest.mark.parametrize("name", ["ada.glb", "crab.glb"])
def test_three_js_plays_a_clip_on_the_character(name: str, tmp_path: Path) -> None:
    source = SAMPLE / name
    character = FORMAT.load(source)
    curves = speech(character.shapes[:6])
    clip = written("animation-only", source, tmp_path / "clip", curves)
    whole = tmp_path / name
    FORMAT.write(character, [line(curves)], whole)
    at_s = np.random.default_rng(2).uniform(0, 3, 20)
    played = three_weights(source, "hello", at_s, clip=clip)
    assert played.keys() == three_weights(whole, "hello", at_s).keys() != set()
    for node, weights in three_weights(whole, "hello", at_s).items():
        np.testing.assert_allclose(played[node], weights, atol=1e-6)
    assert max(np.ptp(weights, axis=0).max() for weights in played.values()) > 0.1


def test_nodes_that_share_a_name_are_told_apart_as_three_js_does(tmp_path: Path) -> None:
    document = face(
        nodes=[{"name": "head", "children": [1]}, {"mesh": 0, "name": "head"}],
        meshes=[mesh(2, ["jawOpen", "blink"], primitives=2) | {"name": "head"}],
    )
    source = face_glb(tmp_path, document)
    clip = written("animation-only", source, tmp_path / "clip", speech(["jawOpen"]))
    played = three_weights(source, "hello", AT_S, clip=clip)
    assert len(played) == 2
    for weights in played.values():
        np.testing.assert_allclose(weights[:, 0], speech(["jawOpen"]).sample(AT_S)[:, 0], atol=1e-4)


def test_a_clip_is_the_same_every_time(tmp_path: Path) -> None:
    source = face_glb(tmp_path)
    clips = [
        written("animation-only", source, tmp_path / name, speech(["jawOpen"])) for name in "ab"
    ]
    assert clips[0].read_bytes() == clips[1].read_bytes()


def test_what_is_all_ours_is_not_stripped(tmp_path: Path) -> None:
    clip = written("animation-only", face_glb(tmp_path), tmp_path / "clip", speech(["jawOpen"]))
    with pytest.raises(InputError, match="strip-whole"):
        FORMAT.strip(clip, clip)


# VRM


def vrm_1(expressions: Json, **members: Any) -> bytes:
    extensions = {"VRMC_vrm": {"specVersion": "1.0", "expressions": expressions}}
    return glb(face(extensions=extensions, **members), (BIN_KIND, TRIANGLE))


def bind(index: int, weight: float = 1.0, node: int = 0) -> Json:
    return {"node": node, "index": index, "weight": weight}


def one(*binds: Json, **members: Any) -> Json:
    return {"morphTargetBinds": list(binds), **members}


def vrm_0() -> bytes:
    groups = [
        {"name": "A", "presetName": "a", "binds": [{"mesh": 0, "index": 0, "weight": 100}]},
        {"name": "Joy", "presetName": "joy", "binds": [{"mesh": 0, "index": 1, "weight": 50}]},
        {"name": "pout", "presetName": "unknown", "binds": [{"mesh": 0, "index": 2, "weight": 80}]},
        {"name": "LookUp", "presetName": "lookup", "binds": []},
    ]
    master = {"blendShapeMaster": {"blendShapeGroups": groups}}
    document = face(["Fcl_A", "Fcl_Joy", "Fcl_Pout"], extensions={"VRM": master})
    return glb(document, (BIN_KIND, TRIANGLE))


def drives(path: Path) -> dict[str, list[tuple[str, float]]]:
    expressions = FORMAT.load(path).expressions
    return {name: [(d.shape, d.gain) for d in made] for name, made in expressions.items()}


def test_expressions_of_both_versions_come_to_the_shapes_they_bind(tmp_path: Path) -> None:
    first = saved(
        tmp_path / "one.vrm",
        vrm_1(
            {
                "preset": {"aa": one(bind(0), bind(1, 0.5)), "happy": one(bind(1), isBinary=True)},
                "custom": {"grin": one(bind(1, 0.25))},
            }
        ),
    )
    assert drives(first) == {
        "aa": [("jawOpen", 1.0), ("mouthClose", 0.5)],
        "grin": [("mouthClose", 0.25)],
    }
    assert drives(saved(tmp_path / "zero.vrm", vrm_0())) == {
        "A": [("Fcl_A", 1.0)],
        "joy": [("Fcl_Joy", 0.5)],
        "pout": [("Fcl_Pout", 0.8)],
    }


def test_targets_without_names_get_those_of_the_expressions_bound_to_them(tmp_path: Path) -> None:
    expressions = {"preset": {"blink": one(bind(0), bind(1)), "aa": one(bind(1, 0.7))}}
    source = saved(tmp_path / "face.vrm", vrm_1(expressions, meshes=[mesh(3, None)]))
    assert FORMAT.load(source).shapes == ("blink", "aa", "target_2")


@pytest.mark.parametrize(
    "broken",
    [
        7, None, [], {"preset": 3}, {"preset": {"aa": None}}, {"preset": {"aa": one(7)}},
        {"preset": {"aa": one({"node": "x"})}}, {"preset": {"aa": one(bind(99))}},
        {"preset": {"aa": one(bind(0, node=-1))}}, {"preset": {"aa": {"morphTargetBinds": 1}}},
    ],
    ids=str,
)  # fmt: skip
def test_a_malformed_expression_is_no_reason_to_refuse_the_mesh(
    broken: Any, tmp_path: Path
) -> None:
    source = saved(tmp_path / "face.vrm", vrm_1(broken))
    assert drives(source) == {}
    FORMAT.write(FORMAT.load(source), [line(speech(["jawOpen"]))], tmp_path / "out.vrm")


def test_a_vrma_says_a_line_in_expressions(tmp_path: Path) -> None:
    curves = speech(["Fcl_A", "Fcl_Joy", "Fcl_Pout"])
    curves = CurveSet(curves.times_s, curves.names, curves.weights * [1, 0.5, 0.8])
    target = written("vrma", saved(tmp_path / "face.vrm", vrm_0()), tmp_path / "out", curves)
    root = document_of(target)
    declared = root["extensions"]["VRMC_vrm_animation"]
    assert declared["specVersion"] == "1.0"
    assert declared["expressions"]["preset"].keys() == {"aa", "happy"}
    assert declared["expressions"]["custom"].keys() == {"pout"}
    assert root["extensionsUsed"] == ["VRMC_vrm_animation"]
    played = vrma_weights(target, AT_S)
    wanted = curves.sample(AT_S) / [1, 0.5, 0.8]
    for column, name in enumerate(("aa", "happy", "pout")):
        np.testing.assert_allclose(played[name], wanted[:, column], atol=1e-4)


def test_a_vrma_has_the_skeleton_of_its_avatar_at_rest(tmp_path: Path, shared: Path) -> None:
    source = shared / "assets" / "vrm" / "three-vrm-core_cube" / "cube.gltf"
    target = written("vrma", source, tmp_path / "out", speech(["aa"]))
    root, theirs = document_of(target), document_of(source)
    bones = root["extensions"]["VRMC_vrm_animation"]["humanoid"]["humanBones"]
    own = theirs["extensions"]["VRMC_vrm"]["humanoid"]["humanBones"]
    assert bones.keys() == own.keys() - {"leftEye", "rightEye"}
    for name, bone in bones.items():
        old, new = theirs["nodes"][own[name]["node"]], root["nodes"][bone["node"]]
        assert new["name"] == old["name"]
        assert new.get("translation") == old.get("translation")
    other = document_of(shared / "assets" / "vrm" / "test.vrma")
    assert root["extensions"].keys() == other["extensions"].keys()
    kinds = {c["target"]["path"] for a in root["animations"] for c in a["channels"]}
    assert kinds == {"translation"}


def test_shapes_named_like_presets_are_enough_for_a_vrma(tmp_path: Path) -> None:
    source = face_glb(tmp_path, face(["aa", "oh", "smirk"]))
    target = written("vrma", source, tmp_path / "out", speech(["aa", "oh"]))
    assert vrma_weights(target, AT_S).keys() == {"aa", "oh"}


def test_a_line_that_no_expression_can_say_is_refused(tmp_path: Path) -> None:
    source = saved(tmp_path / "face.vrm", vrm_1({"preset": {"aa": one(bind(0))}}))
    character = FORMAT.load(source)
    form = FORMAT.for_layout("vrma", character)
    with pytest.raises(InputError, match=r"'mouthClose'.*vrma-inexpressible"):
        form.write(character, [line(speech(["mouthClose"]))], tmp_path / "out" / "a.vrma")
    assert not (tmp_path / "out").exists()
    form.write(character, [line(speech(["jawOpen"]))], tmp_path / "out" / "a.vrma")


def test_layouts_that_an_asset_cannot_have_are_refused(tmp_path: Path) -> None:
    plain = FORMAT.load(face_glb(tmp_path))
    with pytest.raises(InputError, match=r"is no VRM.*layout-unsupported"):
        FORMAT.for_layout("vrma", plain)
    head = UsdFormat().load(SAMPLE / "ada.usdc")
    for layout in ("animation-only", "vrma"):
        with pytest.raises(InputError, match="layout-unsupported"):
            UsdFormat().for_layout(layout, head)
    clip = FORMAT.for_layout("animation-only", plain)
    assert isinstance(clip, AnimationFile)
    with pytest.raises(InputError, match="layout-unsupported"):
        clip.for_layout("per-line", plain)


# Jobs


def test_a_job_writes_a_clip_per_line(tmp_path: Path, capsys: Capture) -> None:
    job = small_job(tmp_path / "job")
    job.timed_line("en/boat")
    job.timed_line("de/boat")
    job.sections["characters.crab"]["layout"] = "animation-only"
    ran = run_inline(capsys, job)
    assert ran.code == 0
    files = {p.relative_to(job.output).as_posix() for p in job.output.rglob("*.glb")}
    assert files == {"en/crab/boat.glb", "de/crab/boat.glb"}
    assert job.animations("en/crab/boat.glb") == {"boat"}
    assert (job.output / "en/crab/boat.glb").stat().st_size < 50_000
    # Sound again, without animation-only: the whole character.
    job.sections["characters.crab"]["layout"] = "per-line"
    run_inline(capsys, job)
    assert (job.output / "en/crab/boat.glb").stat().st_size > 200_000


def test_a_job_writes_vrma_for_an_avatar_and_refuses_what_is_none(
    tmp_path: Path, capsys: Capture
) -> None:
    job = small_job(tmp_path / "job")
    job.timed_line()
    job.sections["characters.crab"] |= {"asset": "ada.vrm", "rig": "arkit", "layout": "vrma"}
    text, chunks = split_glb((SAMPLE / "ada.glb").read_bytes())
    saved(job.folder / "ada.vrm", glb(text, *chunks))
    ran = run_inline(capsys, job)
    assert ran.code == 2
    ran.says("characters.crab", "is no VRM", "animation-only")
    document = json.loads(text)
    meshes = {m.path: m for m in FORMAT.load(SAMPLE / "ada.glb").meshes}
    node, shapes = next((int(p.split("/")[2]), m.shapes) for p, m in meshes.items())
    custom = {name: one(bind(i, node=node)) for i, name in enumerate(shapes)}
    preset = {"aa": one(bind(shapes.index("jawOpen"), node=node))}
    document["extensions"] = {"VRMC_vrm": {"expressions": {"preset": preset, "custom": custom}}}
    saved(job.folder / "ada.vrm", glb(document, *chunks))
    ran = run_inline(capsys, job)
    assert ran.code == 0, ran.err
    played = vrma_weights(job.output / "en/crab/boat.vrma", np.linspace(0, 2, 50))
    assert max(np.ptp(curve) for curve in played.values()) > 0.2


def test_a_clip_of_several_lines_tells_their_names_apart(tmp_path: Path) -> None:
    character = FORMAT.load(face_glb(tmp_path))
    lines = [
        LineAnimation("hello", language, speech(["jawOpen"]), 3.0) for language in ("en", "de")
    ]
    form = FORMAT.for_layout("animation-only", character)
    form.write(character, lines, tmp_path / "clip.glb")
    assert form.read_animations(tmp_path / "clip.glb").keys() == {"hello", "hello_de"}
