"""Digests of code: what a plug-in's results depend on besides its input.

The source files that its module imports, directly or not, within its own distribution and animeme;
the data files in their packages; the versions of whatever else they import. Nothing is imported for
it, and what the files say of each other is remembered by their own digests.
"""

from __future__ import annotations

import ast
import hashlib
import json
import os
import re
import sys
from collections.abc import Iterable, Iterator
from functools import cache, cached_property
from importlib.metadata import distributions
from importlib.util import find_spec
from pathlib import Path

from animeme import registry
from animeme.store.digests import Digests
from animeme.store.index import Index

# Parts of the engine that carry results about and make none.
_CARRIERS = ("animeme.store", "animeme.executors", "animeme.cli", "animeme.registry")
# Where statements have statements within them.
_BLOCKS = ("body", "orelse", "finalbody", "handlers", "cases")
_SKIPPED = ("__pycache__", "node_modules")
# What is remembered of a file's imports changes with this number.
_RULES = 2


class CodeDigests:
    """Digests of plug-ins' code, as it was when each file was first looked at.

    Args:
        index: remembers what files import.
        digests: of files.
    """

    def __init__(self, index: Index, digests: Digests) -> None:
        self._index = index
        self._digests = digests
        self._files: dict[str, str] = {}
        self._imports: dict[str, tuple[str, ...]] = {}
        self._data: dict[str, str] = {}

    def of(self, plugins: Iterable[registry.Plugin], *modules: str) -> str:
        """The digest of all that these plug-ins and modules are made of."""
        named = list(plugins)
        parts = [f"{p.group} {p.name} {p.entry_point.value} {p.version}" for p in named]
        roots = [*(p.entry_point.module for p in named), *modules]
        own = {root.split(".")[0] for root in roots} | {"animeme", "animeme_stages"}
        files, others = self._closure(roots, own)
        parts += [f"{module} {digest}" for module, digest in sorted(files.items())]
        parts += [f"{other} {self._version(other)}" for other in sorted(others)]
        parts.append(f"{sys.version_info[:2]} {sys.platform} {os.uname().machine}")
        return hashlib.sha256("\n".join(sorted(parts)).encode()).hexdigest()

    def _closure(self, roots: Iterable[str], own: set[str]) -> tuple[dict[str, str], set[str]]:
        """Digest of each module and folder of data, and names of what comes from elsewhere."""
        files: dict[str, str] = {}
        others: set[str] = set()
        waiting = list(roots)
        while waiting:
            name = waiting.pop()
            top = name.split(".")[0]
            if name in files or name == "animeme" or name.startswith(_CARRIERS):
                continue
            if top not in own:
                if top not in sys.stdlib_module_names:
                    others.add(top)
                continue
            path = _source_of(name)
            if path is None:  # a name in a module, not a module
                if "." in name:
                    waiting.append(name.rpartition(".")[0])
                continue
            files[name] = self._digest_of(path)
            waiting += self._imported(name, path, files[name])
            folder = os.path.dirname(path)
            if folder not in files and "." in name:
                files[folder] = ""
                files[f"data of {name.rpartition('.')[0]}"] = self._data_of(folder)
        return {name: digest for name, digest in files.items() if digest}, others

    def _digest_of(self, path: str) -> str:
        """Of a source file, "" if it cannot be read."""
        if path not in self._files:
            self._files[path] = self._digests.of(path) or ""
        return self._files[path]

    def _imported(self, name: str, path: str, digest: str) -> tuple[str, ...]:
        """Names that the module imports, relative ones made absolute; parents included."""
        key = f"imports:{_RULES}:{name}:{digest}"
        if key not in self._imports:
            noted = self._index.note(key)
            self._imports[key] = tuple(json.loads(noted)) if noted else _imports(name, path, digest)
            if noted is None:
                self._index.set_note(key, json.dumps(self._imports[key]))
        return self._imports[key]

    def _data_of(self, folder: str) -> str:
        """Digest of the files in a package that are no Python, those of its plain folders too."""
        if folder not in self._data:
            parts = [f"{os.path.relpath(p, folder)} {self._digests.of(p)}" for p in _data(folder)]
            self._data[folder] = hashlib.sha256("\n".join(parts).encode()).hexdigest()
        return self._data[folder]

    def _version(self, module: str) -> str:
        """Version of the distribution that brings a module, "" if it is not installed."""
        name = _normalised(module)
        if name in self._installed:
            return self._installed[name]
        names = [_normalised(found) for found in self._brought_by(module)]
        return " ".join(self._installed.get(found, "") for found in sorted(names))

    def _brought_by(self, module: str) -> list[str]:
        state = hashlib.sha256(json.dumps(self._installed, sort_keys=True).encode()).hexdigest()
        key = f"brought-by:{module}:{state}"
        noted = self._index.note(key)
        if noted is None:
            noted = json.dumps(_bringing(module, state))
            self._index.set_note(key, noted)
        found: list[str] = json.loads(noted)
        return found

    @cached_property
    def _installed(self) -> dict[str, str]:
        """Version of every installed distribution, from the names of their folders."""
        found: dict[str, str] = {}
        for place in sys.path:
            try:
                names = sorted(os.listdir(place or "."))
            except OSError:
                continue
            for name in names:
                if name.endswith((".dist-info", ".egg-info")):
                    project, _, version = name.rpartition(".")[0].partition("-")
                    found.setdefault(_normalised(project), version)
        return found


@cache
def _bringing(module: str, state: str) -> list[str]:
    """Distributions that bring a module, sorted; `state` tells what is remembered.

    `packages_distributions` says it of all modules, and takes ten times as long.
    """
    listed = re.compile(rf"^{re.escape(module)}[/.]", re.MULTILINE)
    found = set()
    for distribution in distributions():
        names = (distribution.read_text("top_level.txt") or "").split()
        files = "" if names else distribution.read_text("RECORD") or ""
        if module in names or listed.search(files):
            found.add(distribution.metadata["Name"])
    return sorted(found)


@cache
def _imports(name: str, path: str, digest: str) -> tuple[str, ...]:
    """Names that a module imports, sorted; `digest`, of the file, tells what is remembered."""
    return tuple(sorted(set(_imported_names(name, path))))


def _imported_names(name: str, path: str) -> Iterator[str]:
    package = name if path.endswith("__init__.py") else name.rpartition(".")[0]
    try:
        tree = ast.parse(Path(path).read_bytes())
    except (SyntaxError, ValueError, OSError):
        return
    if package:
        yield package
    for node in _running(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            parents = package.split(".")[: len(package.split(".")) - node.level + 1]
            base = ".".join([*(parents if node.level else []), *filter(None, [node.module])])
            # What is imported from a package may be a module of it.
            yield from (f"{base}.{alias.name}" for alias in node.names)


def _running(tree: ast.AST) -> Iterator[ast.AST]:
    """The statements of a module, but for what only type checkers see."""
    waiting: list[ast.AST] = [tree]
    while waiting:
        node = waiting.pop()
        yield node
        typing = isinstance(node, ast.If) and _name(node.test) == "TYPE_CHECKING"
        for name in _BLOCKS[1:] if typing else _BLOCKS:
            waiting += getattr(node, name, ())


def _name(test: ast.expr) -> str:
    """Of a plain name or an attribute, the last part; "" of all else."""
    return getattr(test, "id", "") or getattr(test, "attr", "")


def _source_of(module: str) -> str | None:
    """The source file of a module; only its topmost package is looked up, nothing imported."""
    top, _, rest = module.partition(".")
    origin, places = _top(top)
    if not rest:
        return origin
    for place in places:
        *packages, name = rest.split(".")
        folder = "/".join((place, *packages))
        names = _names(folder)
        if f"{name}.py" in names:
            return f"{folder}/{name}.py"
        if name in names and "__init__.py" in _names(f"{folder}/{name}"):
            return f"{folder}/{name}/__init__.py"
    return None


@cache
def _names(folder: str) -> frozenset[str]:
    """What is in a folder; one look for all the modules that may be in it."""
    try:
        return frozenset(os.listdir(folder))
    except OSError:
        return frozenset()


@cache
def _top(name: str) -> tuple[str | None, tuple[str, ...]]:
    """The source of a topmost module or package, and its folders."""
    try:
        spec = find_spec(name)
    except (ImportError, ValueError):
        spec = None
    if spec is None:
        return None, ()
    return spec.origin, tuple(spec.submodule_search_locations or ())


def _data(folder: str) -> Iterator[str]:
    """Files in a package that are no Python, sorted; packages within it have their own."""
    with os.scandir(folder) as found:
        entries = sorted(found, key=lambda entry: entry.name)
    for entry in entries:
        if entry.is_dir():
            inner = os.path.join(entry.path, "__init__.py")
            if entry.name not in _SKIPPED and not os.path.exists(inner):
                yield from _data(entry.path)
        elif not entry.name.endswith((".py", ".pyc", ".pyi", ".typed")):
            yield entry.path


def _normalised(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()
