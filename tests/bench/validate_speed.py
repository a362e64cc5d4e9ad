"""How many small files `animeme validate` judges per second of one core.

    PYTHONPATH=tests python tests/bench/validate_speed.py [--count 1000]

Each is a head of one triangle with the shapes that speak, and one line. Node is not asked, as the
Khronos validator's cost is its own.
"""

from __future__ import annotations

import argparse
import os
import shutil
import tempfile
import time
from pathlib import Path

import numpy as np

from animeme import registry
from animeme.contracts import LineAnimation
from animeme.curves import CurveSet
from animeme.validation import validate
from animeme_stages.check.delivery import khronos_validator
from support.good_delivery import NAMES, tiny_head


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--count", type=int, default=1000)
    count = arguments.parse_args().count
    os.environ["PATH"] = ""
    khronos_validator.find_node = lambda: None
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "delivery"
        source = tiny_head(Path(scratch) / "head.glb")
        form = registry.format_of(source)
        at_s = np.arange(0, 2, 1 / 30)
        weights = 0.3 - 0.3 * np.cos(2 * np.pi * 3 * at_s)
        curves = CurveSet(at_s, NAMES[:1], weights[:, None])
        first = folder / "0.glb"
        folder.mkdir()
        form.write(form.load(source), [LineAnimation("a", "en", curves, 2.0)], first)
        for number in range(1, count):
            shutil.copy(first, folder / f"{number}.glb")
        validate([first])
        start_s, wall_s = time.process_time(), time.perf_counter()
        report = validate([folder])
        cpu_s, wall_s = time.process_time() - start_s, time.perf_counter() - wall_s
    print(
        f"{len(report.files)} files, {len(report.checks)} checks: {cpu_s:.1f} s of one core, "
        f"{len(report.files) / cpu_s:.0f} files per second ({wall_s:.1f} s by the clock); "
        f"{len(report.all_findings)} findings"
    )


if __name__ == "__main__":
    main()
