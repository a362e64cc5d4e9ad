"""What is read of characters to draw them: inbetweens, up-axes, skins, holes in textures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from animeme.rig import Character
from animeme_stages.pictures.raster import Canvas, on_screen
from animeme_stages.pictures.scene import (
    Material,
    Primitive,
    Scene,
    SceneMesh,
    Target,
    load_scene,
    skinned,
    welded,
)
from animeme_stages.pictures.shade import Camera, Renderer

USD = """#usda 1.0
(
    defaultPrim = "Hero"
    upAxis = "{axis}"
    startTimeCode = 0
    endTimeCode = 1
)
def SkelRoot "Hero" ( prepend apiSchemas = ["SkelBindingAPI"] )
{{
    rel skel:skeleton = </Hero/Skel>
    rel skel:animationSource = </Hero/Anim>
    def Skeleton "Skel"
    {{
        uniform token[] joints = ["root"]
        uniform matrix4d[] bindTransforms = [( (1,0,0,0), (0,1,0,0), (0,0,1,0), (0,0,0,1) )]
        uniform matrix4d[] restTransforms = [( (1,0,0,0), (0,1,0,0), (0,0,1,0), (5,0,0,1) )]
    }}
    def SkelAnimation "Anim"
    {{
        uniform token[] blendShapes = ["open"]
        float[] blendShapeWeights.timeSamples = {{ 0: [0], 1: [1] }}
    }}
    def Mesh "Face" ( prepend apiSchemas = ["SkelBindingAPI"] )
    {{
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(0,0,0), (1,0,0), (1,2,0), (0,2,0)]
        int[] primvars:skel:jointIndices = [0, 0, 0, 0] (
            interpolation = "vertex"
            elementSize = 1
        )
        float[] primvars:skel:jointWeights = [1, 1, 1, 1] (
            interpolation = "vertex"
            elementSize = 1
        )
        uniform token[] skel:blendShapes = ["open"]
        rel skel:blendShapeTargets = </Hero/Face/open>
        def BlendShape "open"
        {{
            uniform int[] pointIndices = [2]
            uniform vector3f[] offsets = [(0,4,0)]
            uniform vector3f[] inbetweens:half = [(0,3,0)] ( weight = 0.5 )
        }}
    }}
}}
"""


def usd(folder: Path, axis: str) -> SceneMesh:
    path = folder / "hero.usda"
    path.write_text(USD.format(axis=axis), encoding="utf-8")
    (mesh,) = load_scene(path).meshes
    return mesh


def test_inbetweens_are_passed_through(tmp_path: Path) -> None:
    mesh = usd(tmp_path, "Y")
    heights = [mesh.deformed({"open": w})[2, 1] - 2.0 for w in (0.0, 0.25, 0.5, 0.75, 1.0, 1.5)]
    assert heights == pytest.approx([0.0, 1.5, 3.0, 3.5, 4.0, 5.0])


def test_usd_stands_upright_where_its_skeleton_rests(tmp_path: Path) -> None:
    assert usd(tmp_path, "Y").points[2] == pytest.approx([6.0, 2.0, 0.0])
    # What is up in the file, +Z, is +Y here; what was behind, +Y, is -Z.
    assert usd(tmp_path, "Z").points[2] == pytest.approx([6.0, 0.0, -2.0])


def test_negative_weights_go_the_other_way() -> None:
    target = Target((0.5, 1.0), np.zeros((2, 1, 3)))
    assert target.factors(-0.5) == pytest.approx([-1.0, 0.0])
    assert Target((1.0,), np.zeros((1, 1, 3))).factors(-2.0) == [-2.0]


def test_joints_share_a_vertex() -> None:
    moved = np.eye(4)
    moved[:3, 3] = [0.0, 2.0, 0.0]
    points, (offsets,) = skinned(
        np.zeros((2, 3)),
        [np.ones((1, 2, 3))],
        np.array([[0, 1], [0, 1]]),
        np.array([[1.0, 3.0], [0.0, 0.0]]),
        np.stack([np.eye(4), moved]),
    )
    # A vertex that no joint holds stays.
    assert points[:, 1] == pytest.approx([1.5, 0.0])
    assert offsets == pytest.approx(np.ones((1, 2, 3)))


def test_hard_edges_stay_hard() -> None:
    points = np.zeros((3, 3))
    normals = np.array([[0, 0, 1], [0, 0.1, 1], [1, 0, 0]], np.float32)
    first, near, other = welded(points, normals)
    assert first == near != other
    assert len(set(welded(points).tolist())) == 1


def quad(z: float, material: Material) -> SceneMesh:
    points = np.array([[-1, -1, z], [1, -1, z], [1, 1, z], [-1, 1, z]], np.float64)
    uv = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32)
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    return SceneMesh("quad", points, [Primitive(triangles, material)], {}, {}, np.arange(4), uv)


def test_holes_show_what_is_behind() -> None:
    texture = np.ones((4, 4, 4), np.float32)
    texture[..., [0, 2]] = 0.0  # green
    texture[1:3, 1:3, 3] = 0.0
    meshes = (
        quad(0.0, Material((1.0, 0.0, 0.0))),
        quad(0.1, Material((1.0, 1.0, 1.0), texture=texture, cutoff=0.5)),
    )
    scene = Scene(Character(Path("none"), "gltf", ()), meshes)
    image = Renderer(scene, Camera((0, 0, 0), 2.2, 0.4), (64, 64), supersample=1).picture({})
    red, green = image[32, 32].astype(int), image[8, 32].astype(int)
    assert red[0] > red[1] + 50
    assert green[1] > green[0] + 50


def test_back_of_what_has_one_side_is_not_drawn() -> None:
    scene = Scene(Character(Path("none"), "gltf", ()), (quad(0.0, Material((1.0, 0.0, 0.0))),))
    both = Scene(scene.character, (quad(0.0, Material((1.0, 0.0, 0.0), double_sided=True)),))
    behind = Camera((0, 0, 0), 2.2, 0.4, yaw=180.0)
    hidden, seen = (
        Renderer(shown, behind, (32, 32), supersample=1).picture({})[16, 16].astype(int)
        for shown in (scene, both)
    )
    assert abs(hidden[0] - hidden[1]) < 20
    assert seen[0] > seen[1] + 50


def test_triangles_that_share_an_edge_leave_no_gap() -> None:
    rng = np.random.default_rng(7)
    grid = np.stack(np.meshgrid(np.arange(9.0), np.arange(9.0)), axis=-1) * 8.0
    grid[1:-1, 1:-1] += rng.uniform(-3, 3, (7, 7, 2))
    index = np.arange(81).reshape(9, 9)
    a, b, c, d = (index[i : i + 8, j : j + 8].ravel() for i, j in ((0, 0), (0, 1), (1, 1), (1, 0)))
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    canvas = Canvas(64, 64)
    canvas.fill(on_screen(grid.reshape(-1, 2), np.ones(81), triangles), np.arange(len(triangles)))
    pixels, shown = canvas.pixels()
    assert len(pixels) == 64 * 64
    assert set(shown.tolist()) == set(range(len(triangles)))
