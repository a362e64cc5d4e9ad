"""An asset whose reading takes the process down costs its own character, and nothing else."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from support.jobs import console, small_job
from test_worker_death import studio

# A format whose reader dies, as native code does over a damaged file.
READER = """
import os, signal

from animeme_stages.write.gltf import GltfFormat


class Deadly(GltfFormat):
    name = "deadly"
    suffixes = (".deadly",)

    def load(self, path, *, within=None):
        os.kill(os.getpid(), signal.SIGSEGV)
"""


@pytest.mark.slow
def test_a_reader_that_dies_fails_its_own_character(tmp_path: Path) -> None:
    entry_points = "[animeme.formats]\ndeadly = deadly_format:Deadly\n"
    site = studio(tmp_path / "site", "deadly", entry_points, {"deadly_format": READER})
    job = small_job(tmp_path / "job", "en/boat")
    (job.folder / "hero.deadly").write_bytes(b"damaged")
    job.sections["characters.hero"] = {"asset": "hero.deadly"}
    file = job.write()
    path = os.pathsep.join([str(site), *filter(None, [os.environ.get("PYTHONPATH")])])
    for _ in range(2):  # what is wrong with it is not taken for known
        ran = console("run", file, "--workers", "2", env={"PYTHONPATH": path})
        ran.says("hero")
        assert ran.code == 1
        assert job.statuses() == {"en/boat": "ok"}
        assert job.statuses("hero") == {"en/boat": "failed"}
        (finding,) = [f for f in job.report()["findings"] if f["character"] == "hero"]
        assert finding["code"] == "asset-unreadable"
        assert "crashed" in finding["message"]
