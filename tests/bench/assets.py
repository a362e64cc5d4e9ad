"""How long glTF takes, and how much memory: ``python tests/bench/assets.py [MEGABYTES]``.

A GLB is made of that size (300 by default, all but a face of it opaque bytes, as textures are), and
another whose JSON alone is tens of megabytes. Each step runs in a process of its own, after one
that does nothing but import the same modules; time and memory are what the step costs beyond that.
"""

from __future__ import annotations

import filecmp
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
KEYS, SHAPES, LINES = 300, 20, 10


def make(path: Path, megabytes: int, *, accessors: int = 0) -> None:
    """A face of `SHAPES` targets and `megabytes` of bytes that mean nothing to us."""
    from support.gltf_build import BIN_KIND, TRIANGLE, face, glb

    names = [f"shape{index}" for index in range(SHAPES)]
    document = face(names)
    document["accessors"] += [
        {**document["accessors"][0], "name": f"a{i}"} for i in range(accessors)
    ]
    size = megabytes * 1_000_000 // 4 * 4
    document["buffers"][0]["byteLength"] = len(TRIANGLE) + size
    noise = np.random.default_rng(0).integers(0, 256, 1 << 20, np.uint8).tobytes()
    head = glb(document, (BIN_KIND, TRIANGLE))
    with path.open("wb") as stream:
        total = len(head) + size
        chunk = head[: -len(TRIANGLE) - 8]
        stream.write(chunk[:8] + total.to_bytes(4, "little") + chunk[12:])
        stream.write((len(TRIANGLE) + size).to_bytes(4, "little") + BIN_KIND + TRIANGLE)
        for start in range(0, size, len(noise)):
            stream.write(noise[: min(len(noise), size - start)])


def step(name: str, source: Path, target: Path, lines: int) -> None:
    """Do one step, and print its seconds and the peak of memory."""
    from animeme.contracts import LineAnimation
    from animeme.curves import CurveSet
    from animeme_stages.write.gltf import GltfFormat

    form = GltfFormat()
    random = np.random.default_rng(1)
    names = tuple(f"shape{index}" for index in range(SHAPES))
    curves = CurveSet(np.linspace(0, 5, KEYS), names, random.uniform(0, 1, (KEYS, SHAPES)))
    spoken = [LineAnimation(f"line{i}", "en", curves, 5.0) for i in range(lines)]
    wall, cpu = time.perf_counter(), time.process_time()
    if name == "copy":
        shutil.copyfile(source, target)
        with target.open("rb+") as stream:
            os.fsync(stream.fileno())
    elif name == "write":
        form.write(form.load(source), spoken, target)
    elif name == "harm":
        assert form.harm(form.load(source), target) == []
    elif name == "read":
        assert len(form.read_animations(target)) == lines
    elif name == "strip":
        form.strip(target, target.with_suffix(".back.glb"))
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(json.dumps({"wall_s": wall, "cpu_s": cpu, "peak_mb": peak}))


def measured(name: str, source: Path, target: Path, lines: int = LINES) -> dict[str, float]:
    """A step in a process of its own: the best of three."""
    command = [sys.executable, __file__, "--step", name, str(source), str(target), str(lines)]
    runs = []
    for _ in range(3):
        done = subprocess.run(command, check=True, capture_output=True, text=True)
        runs.append(json.loads(done.stdout))
    return {key: min(run[key] for run in runs) for key in runs[0]}


def report(title: str, source: Path, folder: Path) -> None:
    """Print what every step costs on one asset."""
    target = folder / "out.glb"
    idle = measured("idle", source, target)
    copy = measured("copy", source, folder / "copy.glb")
    print(f"\n{title}: {source.stat().st_size / 1e6:.0f} MB")
    for name in ("copy", "write", "harm", "read", "strip"):
        cost = copy if name == "copy" else measured(name, source, target)
        more = cost["peak_mb"] - idle["peak_mb"]
        print(
            f"  {name:6} {cost['wall_s']:6.2f} s wall {cost['cpu_s']:6.2f} s CPU "
            f"{more:7.1f} MB more than idle, {cost['wall_s'] / copy['wall_s']:.2f} x the copy"
        )
    same = filecmp.cmp(source, target.with_suffix(".back.glb"), shallow=False)
    print(f"  the stripped file is the source: {same}; it grew by "
          f"{(target.stat().st_size - source.stat().st_size) / 1e3:.0f} kB")  # fmt: skip


def main(megabytes: int) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        make(folder / "large.glb", megabytes)
        report("large binary", folder / "large.glb", folder)
        (folder / "large.glb").unlink()
        make(folder / "wordy.glb", 1, accessors=200_000)
        report("large JSON", folder / "wordy.glb", folder)
        make(folder / "small.glb", 1)
        print("\nlines in one file")
        for lines in (25, 50, 100, 200):
            cost = measured("write", folder / "small.glb", folder / "lines.glb", lines)
            print(f"  {lines:4} lines: {cost['wall_s']:.3f} s wall, {cost['cpu_s']:.3f} s CPU")


if __name__ == "__main__":
    sys.path[:0] = [str(ROOT / "tests")]
    if sys.argv[1:2] == ["--step"]:
        step(sys.argv[2], Path(sys.argv[3]), Path(sys.argv[4]), int(sys.argv[5]))
    else:
        main(int(sys.argv[1]) if len(sys.argv) > 1 else 300)
