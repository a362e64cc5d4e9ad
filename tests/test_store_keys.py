"""Everything that the work on a line is given is declared: keyed on, or not, with the reason."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest

from animeme import registry
from animeme.curve_options import CurveOptions
from animeme.dialogue import Line
from animeme.job import CharacterJob, Job
from animeme.store import keys
from animeme.store.code import CodeDigests
from animeme.store.digests import ABSENT, Digests
from animeme.store.entries import Store
from animeme.store.index import Index
from animeme.tasks import LineItem, RunContext, Target


@pytest.mark.parametrize(
    ("subject", "declared"),
    [
        (Line, keys.LINE),
        (RunContext, keys.CONTEXT),
        (CurveOptions, keys.CURVES),
        (Target, keys.TARGET),
        (LineItem, keys.ITEM),
        (Job, keys.JOB),
        (CharacterJob, keys.CHARACTER),
    ],
)
def test_every_field_is_declared(subject: Any, declared: dict[str, Any]) -> None:
    missing = {field.name for field in fields(subject)} - declared.keys()
    assert not missing, (
        f"say in animeme/store/keys.py whether the results of a line depend on {missing}"
    )
    gone = declared.keys() - {field.name for field in fields(subject)}
    assert not gone


def test_only_the_tables_that_are_read_declare_values_and_files() -> None:
    for table in (keys.TARGET, keys.ITEM, keys.JOB, keys.CHARACTER):
        assert not any(isinstance(entry, keys.Value | keys.File) for entry in table.values())


def test_a_file_is_known_by_its_stamp_and_read_when_that_changes(tmp_path: Path) -> None:
    path = tmp_path / "file"
    with Index(tmp_path / "index.sqlite") as index:
        digests = Digests(index)
        assert digests.of(path) == ABSENT
        path.write_text("one")
        first = digests.of(path)
        path.write_text("two")
        assert digests.of(path) not in (first, ABSENT, None)
        path.write_text("one")
        assert digests.of(path) == first


def test_a_file_that_is_quite_new_is_not_trusted_to_stay_as_it_is(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_text("one")
    soon = time.time() + 60
    os.utime(path, (soon, soon))
    with Index(tmp_path / "index.sqlite") as index:
        Digests(index).of(path)
        assert index.file(str(path)) is None


def test_an_index_that_is_broken_is_begun_anew(tmp_path: Path) -> None:
    path = tmp_path / "index.sqlite"
    path.write_bytes(b"no database at all, " * 1000)
    with Index(path) as index:
        index.set_note("a", "b")
    with Index(path) as index:
        assert index.note("a") == "b"


def test_an_index_that_cannot_be_written_is_done_without(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with Index(tmp_path / "file" / "index.sqlite") as index:
        index.set_note("a", "b")
        assert index.note("a") == "b"


def test_two_indexes_of_one_file_do_not_disturb_each_other(tmp_path: Path) -> None:
    path = tmp_path / "index.sqlite"
    with Index(path) as one, Index(path) as two:
        one.set_note("a", "1")
        two.set_note("b", "2")
    with Index(path) as index:
        assert index.notes(["a", "b", "c"]) == {"a": "1", "b": "2"}


@pytest.mark.parametrize("damage", ["cut", "empty", "changed", "another's"])
def test_an_entry_that_is_not_what_was_put_there_is_absent(damage: str, tmp_path: Path) -> None:
    store = Store(tmp_path)
    key, other = "a" * 64, "b" * 64
    store.put(key, {"value": 1}, b"payload")
    store.put(other, {"value": 2}, b"payload")
    found = store.get(key)
    assert found is not None
    assert (found.value, found.payload) == ({"value": 1}, b"payload")
    path = store.path(key)
    data = path.read_bytes()
    spoilt = {
        "cut": data[:-1],
        "empty": b"",
        "changed": data[:-1] + b"?",
        "another's": store.path(other).read_bytes(),
    }
    path.write_bytes(spoilt[damage])
    assert store.get(key) is None
    assert store.damaged == [key]


def test_what_a_dead_process_had_begun_goes_even_if_nobody_asked_how_it_ended(
    tmp_path: Path,
) -> None:
    store = Store(tmp_path)
    store.put("ab" * 32, {})
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as process:
        own = store.scratch()
        others = own.with_name(own.name.replace(f"-{os.getpid()}-", f"-{process.pid}-"))
        for path in (own, others):
            path.touch()
        assert store.sweep() == 0
        process.kill()
        os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
        assert store.sweep() == 1
        assert [*own.parent.iterdir()] == [own]


def test_code_is_known_by_what_it_imports_and_the_data_beside_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = tmp_path / "studio_code"
    package.mkdir()
    files = {
        "__init__.py": "",
        "main.py": "from studio_code import helper\n",
        "helper.py": "from .deeper import depth\n",
        "deeper.py": "depth = 1\n",
        "stranger.py": "",
        "table.json": "{}",
    }
    for name, text in files.items():
        (package / name).write_text(text)
    monkeypatch.syspath_prepend(tmp_path)

    def digest() -> str:
        with Index(None) as index:
            return CodeDigests(index, Digests(index)).of((), "studio_code.main")

    first = digest()
    for name in ("main.py", "helper.py", "deeper.py", "table.json"):
        (package / name).write_text(files[name] + " ")
        assert digest() != first, name
        (package / name).write_text(files[name])
        assert digest() == first
    (package / "stranger.py").write_text("changed = True\n")
    assert digest() == first


def test_code_is_known_by_the_versions_of_what_brings_other_modules(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "studio_versions.py").write_text("import listed\nfrom named import part\n")
    monkeypatch.syspath_prepend(tmp_path)

    def install(version: str, **names: str) -> None:
        """A distribution with the module of another name, and a file that says so."""
        for name, (file, text) in {
            "wheel": ("RECORD", "listed/__init__.py,,\nlisted/named/x.py,,\n"),
            "egg": ("top_level.txt", "named\n"),
            "stranger": ("RECORD", "unlisted.py,,\nits/listed.py,,\n"),
        }.items():
            for old in tmp_path.glob(f"studio_{name}-*"):
                shutil.rmtree(old)
            folder = tmp_path / f"studio_{name}-{names.get(name, version)}.dist-info"
            folder.mkdir()
            (folder / "METADATA").write_text(f"Metadata-Version: 2.1\nName: studio-{name}\n")
            (folder / file).write_text(text)

    def digest() -> str:
        with Index(None) as index:
            return CodeDigests(index, Digests(index)).of((), "studio_versions")

    install("1")
    first = digest()
    for name in ("wheel", "egg"):
        install("1", **{name: "2"})
        assert digest() != first, name
    install("1", stranger="2")
    assert digest() == first


@pytest.mark.parametrize(
    ("test", "counts"),
    [
        ("TYPE_CHECKING", False),
        ("typing.TYPE_CHECKING", False),
        ("not TYPE_CHECKING", True),
        ("sys.platform == 'linux'", True),
    ],
)
def test_what_only_type_checkers_import_is_no_code(
    test: str, counts: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = f"studio_{tmp_path.name}"  # where a module lies is looked up once
    folder = tmp_path / name
    folder.mkdir()
    (folder / "__init__.py").touch()
    (folder / "main.py").write_text(f"if {test}:\n    from {name} import helper\n")
    monkeypatch.syspath_prepend(tmp_path)
    found = set()
    for text in ("first = 1", "second = 2"):
        (folder / "helper.py").write_text(text)
        with Index(None) as index:
            found.add(CodeDigests(index, Digests(index)).of((), f"{name}.main"))
    assert len(found) == (2 if counts else 1)


def test_the_code_of_our_own_plugins_is_found() -> None:
    with Index(None) as index:
        code = CodeDigests(index, Digests(index))
        models = registry.plugins(registry.MODELS)
        found = {name: code.of([plugin]) for name, plugin in models.items()}
    assert len(set(found.values())) == len(found)
