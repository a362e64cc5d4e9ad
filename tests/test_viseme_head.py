"""A head of whole mouths speaks: the sample head's shapes, made into Oculus visemes.

Each viseme is sculpted as artists do, fuller than what the profile says it shows; what comes of it
is measured on the mesh, as in `test_mouth`.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import animeme
from animeme.findings import RunReport
from animeme_stages.pictures.scene import load_scene
from animeme_stages.retarget.profile_files import shipped_profile
from conftest import SAMPLE
from sculpt.ada import build_ada
from sculpt.glb import write_glb
from sculpt.mesh import Mesh
from support.mouth import ada_mouth
from test_mouth import CLOSED, OPEN, OPEN_VOWELS, spoken, tracks

FULLER = 1.25


def as_visemes(mesh: Mesh) -> Mesh:
    profile = shipped_profile("oculus")
    made = {
        shape: FULLER
        * sum(
            (
                v * mesh.targets[c]
                for c, v in profile.poses.get(shape, {}).items()
                if c in mesh.targets
            ),
            start=np.zeros_like(mesh.points),
        )
        for shape in profile.shapes
    }
    return replace(mesh, targets=made if mesh.targets else {})


@pytest.fixture(scope="module")
def viseme_run(tmp_path_factory: pytest.TempPathFactory) -> tuple[RunReport, Path]:
    folder = tmp_path_factory.mktemp("visemes")
    ada = build_ada()
    write_glb(replace(ada, meshes=[as_visemes(mesh) for mesh in ada.meshes]), folder / "vis.glb")
    (folder / "job.toml").write_text(
        f'[job]\nname = "v"\n[dialogue]\nroot = "{(SAMPLE / "dialogue").as_posix()}"\n'
        '[characters.vis]\nasset = "vis.glb"\n',
        encoding="utf-8",
    )
    return animeme.run(folder / "job.toml"), folder / "out"


@pytest.mark.slow
def test_a_viseme_head_closes_and_opens(viseme_run: tuple[RunReport, Path]) -> None:
    report, output = viseme_run
    assert report.exit_code == 0
    closures: list[float] = []
    openings: list[float] = []
    for language in ("de", "en", "es"):
        mouth = ada_mouth(load_scene(output / language / "vis.glb")).measured_only()
        for line, track in tracks(output / "alignments" / language).items():
            for phone in spoken(track, frozenset("pbm")):
                at_s = phone.start_s + 0.3 * phone.duration_s
                closures.append(mouth.lip_gap(mouth.weights_at(line, at_s)))
            for phone in spoken(track, OPEN_VOWELS):
                at_s = np.linspace(phone.start_s, phone.end_s, 7)
                gaps = [mouth.lip_gap(mouth.weights_at(line, float(t))) for t in at_s]
                openings.append(max(gaps))
    assert len(closures) > 30
    assert np.mean(np.array(closures) <= CLOSED) >= 0.85
    assert max(closures) <= 1.5 * CLOSED
    assert np.mean(np.array(openings) >= OPEN) >= 0.9
