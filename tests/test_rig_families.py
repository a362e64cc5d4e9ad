"""Rigs of every family are known by their names, however exporters spelt them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from animeme import registry
from animeme.errors import InputError
from animeme.rig import Character, Drive, MeshShapes
from animeme_stages.retarget.profile_files import arkit_controls, profile_names, shipped_profile
from animeme_stages.retarget.profiles import bind, bind_rig, detect
from support.rigs import character

FAMILIES = profile_names()
VISEMES = ("sil", "PP", "FF", "TH", "DD", "kk", "CH", "SS", "nn", "RR", "aa", "E", "ih", "oh", "ou")
READY_PLAYER_ME = [f"viseme_{v}" for v in (*VISEMES[:12], "I", "O", "U")]
STYLES: dict[str, Callable[[str], str]] = {
    "as it is": lambda name: name,
    "upper case": str.upper,
    "a prefix and a dot": lambda name: f"blendShape1.{name}",
    "a prefix and an underscore": lambda name: f"head_{name}",
    "two prefixes": lambda name: f"Armature|c_head_{name}",
    "a prefix without a mark": lambda name: f"face{name[0].upper()}{name[1:]}",
}


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("style", STYLES)
def test_a_whole_family_is_known_in_every_spelling(family: str, style: str) -> None:
    profile = shipped_profile(family)
    names = [STYLES[style](name) for name in profile.shapes]
    bound = detect(character(["Basis", *names, *profile.marks]))
    assert bound.profile.name == family
    assert (bound.coverage, bound.missing) == (1.0, ())
    assert bound.mapped == dict(zip(profile.shapes, names, strict=True))


NAMED = {
    "Oculus, bare": (VISEMES, "oculus"),
    "Ready Player Me, visemes": ([*READY_PLAYER_ME, "mouthOpen", "mouthSmile"], "oculus"),
    "VRChat": ([f"vrc.v_{v.lower()}" for v in VISEMES], "oculus"),
    "Ready Player Me, both sets": (
        [*READY_PLAYER_ME, *arkit_controls(), "mouthOpen", "mouthSmile"],
        "ready-player-me",
    ),
    "Ready Player Me, default": (["mouthOpen", "mouthSmile"], "ready-player-me"),
    "VRoid": ([f"Face.M_F00_000_00_Fcl_MTH_{v}" for v in "AIUEO"], "vrm0"),
    "MMD": (list("あいうえお"), "vrm0"),
    "VRM with ARKit's shapes": ([*"AIUEO", *arkit_controls()], "arkit"),
    "Character Creator, ARKit set": (
        [f"A{i + 1:02}_{name}" for i, name in enumerate(arkit_controls())],
        "arkit",
    ),
    "Papagayo": (["AI", "E", "O", "U", "etc", "L", "WQ", "MBP", "FV", "rest"], "preston-blair"),
    "speech shapes only": (["jawOpen", "mouthClose", "mouthPucker", "mouthFunnel"], "arkit"),
}  # fmt: skip


@pytest.mark.parametrize("case", NAMED)
def test_rigs_as_their_tools_export_them(case: str) -> None:
    names, family = NAMED[case]
    bound = detect(character(names))
    assert bound.profile.name == family


NOBODYS = {
    "a robot": ["Angry", "Surprised", "Sad"],
    "eyes only": [name for name in arkit_controls() if name.startswith(("eye", "brow"))],
    "two letters": ["A", "E"],
    "numbers": ["target_0", "target_1"],
    "words that families use": ["open", "wide", "rest", "L"],
}


@pytest.mark.parametrize("case", NOBODYS)
def test_what_is_no_speaking_rig_is_refused(case: str) -> None:
    with pytest.raises(InputError, match="no known rig family") as caught:
        detect(character(NOBODYS[case]))
    assert NOBODYS[case][0] in str(caught.value)


def test_one_shape_under_a_prefix_per_mesh_moves_on_all_of_them() -> None:
    names = ["jawOpen", "mouthClose", "mouthFunnel", "mouthPucker"]
    hero = character([f"head_{n}" for n in names], [f"teeth_{n}" for n in names[:3]])
    bound = detect(hero)
    assert bound.binds[bound.mapped["jawOpen"]] == (Drive("head_jawOpen"), Drive("teeth_jawOpen"))
    assert bound.mapped["mouthPucker"] == "head_mouthPucker"


def expressive(**expressions: tuple[Drive, ...]) -> Character:
    mesh = MeshShapes("/nodes/0", "face", ("Key1", "Key2", "aa"), (0.0, 0.0, 0.0))
    return Character(Path("hero.vrm"), "gltf", (mesh,), expressions=expressions)


def test_expressions_of_the_file_go_before_names() -> None:
    bound = detect(expressive(aa=(Drive("Key1"),), oh=(Drive("Key1", 0.5), Drive("Key2"))))
    assert bound.profile.name == "vrm1"
    assert bound.mapped == {"aa": "Key1", "oh": "oh"}
    assert bound.binds == {"oh": (Drive("Key1", 0.5), Drive("Key2"))}
    assert bound.missing == ("ih", "ou", "ee")


def test_an_expression_with_the_name_of_a_shape_is_not_mixed_up_with_it() -> None:
    bound = detect(expressive(aa=(Drive("aa", 0.5), Drive("Key2")), ou=(Drive("aa"),)))
    assert bound.mapped["ou"] == "aa"
    assert bound.binds[bound.mapped["aa"]] == (Drive("aa", 0.5), Drive("Key2"))


def test_expressions_that_are_no_mouth_help_nothing() -> None:
    with pytest.raises(InputError, match="no known rig family"):
        detect(expressive(happy=(Drive("Key1"),)))


FALLBACKS = {
    "rounding": ("mouthFunnel", Drive("mouthPucker", 0.7)),
    "the lower lip to the teeth": ("mouthRollLower", Drive("mouthShrugLower", 0.6)),
    "a joint shape for both sides": ("mouthSmileLeft", Drive("mouthSmile", 0.5)),
    "closing opens less": ("mouthClose", Drive("jawOpen", -1.0)),
    "the nearer of two": ("mouthStretchLeft", Drive("mouthStretch", 0.5)),
}


@pytest.mark.parametrize("case", FALLBACKS)
def test_a_missing_shape_is_moved_by_the_nearest(case: str) -> None:
    shape, stand_in = FALLBACKS[case]
    own = ["jawOpen", "mouthPucker", "mouthShrugLower", "mouthSmile", "mouthStretch", "Smile_L"]
    bound = bind(shipped_profile("arkit"), character(own))
    assert shape in bound.missing
    assert bound.fallbacks[shape] == stand_in
    assert bound.profile.drives[shape] == (stand_in,)


def test_controls_that_move_nothing_are_refused_by_name(tmp_path: Path) -> None:
    hero = character(arkit_controls())
    assert bind_rig("auto", hero, tmp_path, controls=("jawOpen", "purr")).coverage == 1.0
    with pytest.raises(InputError, match="rig-controls-unknown") as caught:
        bind_rig("auto", hero, tmp_path, controls=("purr", "hiss"))
    assert "purr, hiss" in str(caught.value)
    assert 'extends = "arkit"' in str(caught.value)


ICT = ("ict_multimesh_speech.glb", "ict_multimesh_speech.usdc")
ASSETS = Path(__file__).parents[2] / "shared" / "assets"
SUFFIXES = (".glb", ".gltf", ".vrm", ".vrma", ".usda", ".usdc", ".usd", ".usdz")
REAL = sorted(path for path in ASSETS.rglob("*") if path.suffix.lower() in SUFFIXES)
# The assets that speak, and how; every other one is refused, for it has no mouth.
KNOWN = {
    **dict.fromkeys(ICT, "arkit"),
    "saturday06_simple_morph.vrm": "vrm0",
    "cube.gltf": "vrm1",  # its expression "aa" is bound
}
REFUSALS = {
    "rig-unknown", "asset-no-blendshapes", "asset-instanced", "asset-format-unknown"
}  # fmt: skip


@pytest.mark.skipif(not REAL, reason="no ../shared with real assets beside this checkout")
@pytest.mark.parametrize("path", REAL, ids=lambda path: path.name)
def test_every_real_asset_is_known_or_refused(path: Path) -> None:
    try:
        bound = detect(registry.format_of(path).load(path))
    except InputError as error:
        assert error.code in REFUSALS  # noqa: PT017
        assert str(path) in str(error)  # noqa: PT017
        assert path.name not in KNOWN
    else:
        assert KNOWN.get(path.name) == bound.profile.name
