"""Compressed meshes and textures pass through: nobody looks at them, nothing of them changes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from support.gltf_build import BIN_KIND, TRIANGLE, document_of, face, glb, text_of
from support.gltf_kit import FORMAT, animate, line, require_agreement, saved, speech
from support.jobs import SAMPLE
from support.judges import khronos_findings, node_answer, three_weights

USES = {
    "meshopt": {"EXT_meshopt_compression", "KHR_mesh_quantization"},
    "quantize": {"KHR_mesh_quantization"},
    "draco": {"KHR_draco_mesh_compression"},
}


@pytest.mark.slow
@pytest.mark.parametrize("how", USES)
def test_a_compressed_character_speaks(how: str, tmp_path: Path) -> None:
    source = tmp_path / "in.glb"
    node_answer("@gltf-transform/core", "compress.mjs", str(SAMPLE / "crab.glb"), str(source), how)
    for extension in USES[how]:
        # Named as used and as required, and really used.
        assert text_of(source).count(f'"{extension}"') > 1 + (extension != "KHR_mesh_quantization")
    shapes = FORMAT.load(source).shapes
    assert shapes == FORMAT.load(SAMPLE / "crab.glb").shapes
    target = tmp_path / "out.glb"
    curves = speech(shapes)
    animate(source, target, curves, plain=True)
    found = khronos_findings(source, target)
    assert not found[target] - found[source]
    at_s = np.linspace(0, 3, 20)
    played = three_weights(target, "hello", at_s)
    require_agreement(played, curves, at_s, FORMAT.load(source))


def test_textures_and_meshes_of_unknown_coding_are_opaque(tmp_path: Path) -> None:
    ktx2 = b"\xabKTX 20\xbb\r\n\x1a\n" + bytes(range(64))
    document = face(
        extensionsUsed=["KHR_texture_basisu", "KHR_draco_mesh_compression", "VENDOR_x"],
        extensionsRequired=["KHR_texture_basisu"],
        images=[{"bufferView": 1, "mimeType": "image/ktx2"}],
        textures=[{"extensions": {"KHR_texture_basisu": {"source": 0}}}],
        bufferViews=[
            {"buffer": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": len(ktx2)},
        ],
    )
    primitive = document["meshes"][0]["primitives"][0]
    primitive["extensions"] = {
        "KHR_draco_mesh_compression": {"bufferView": 1, "attributes": {"POSITION": 0}}
    }
    del document["accessors"][0]["bufferView"]
    document["buffers"][0]["byteLength"] = 36 + len(ktx2)
    source = saved(tmp_path / "face.glb", glb(document, (BIN_KIND, TRIANGLE + ktx2)))
    animate(source, tmp_path / "out.glb", plain=True)


def test_sparse_targets_without_a_view_stay_as_they_are(tmp_path: Path) -> None:
    document = face()
    sparse = {
        "count": 1,
        "indices": {"bufferView": 0, "componentType": 5125},
        "values": {"bufferView": 0, "byteOffset": 12},
    }
    document["accessors"].append(
        {"componentType": 5126, "count": 3, "type": "VEC3", "sparse": sparse}
    )
    document["meshes"][0]["primitives"][0]["targets"] = [{"POSITION": 1}] * 2
    source = saved(tmp_path / "face.glb", glb(document, (BIN_KIND, TRIANGLE)))
    FORMAT.write(FORMAT.load(source), [line(speech(["jawOpen"]))], tmp_path / "out.glb")
    assert document_of(tmp_path / "out.glb")["accessors"][1] == document["accessors"][1]
    animate(source, tmp_path / "out.glb", plain=True)
