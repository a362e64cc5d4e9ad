"""Break one thing, and exactly its code is found; mend it, and nothing is."""

from __future__ import annotations

from pathlib import Path

import pytest

from animeme.validation import delivery_checks, validate
from support.breaks import BREAKS, ELSEWHERE, Case
from support.good_delivery import Good, deliver
from support.jobs import SAMPLE

# Asked only where it is broken: it starts Node for every call.
_NODE = "khronos"
SHARED_HEAD = Path("assets", "ict", "ict_multimesh_speech.glb")


@pytest.fixture(autouse=True)
def _validator(monkeypatch: pytest.MonkeyPatch) -> None:
    """The Khronos validator that the tests' own set-up brings."""
    monkeypatch.setenv("NODE_PATH", str(Path(__file__).with_name("node") / "node_modules"))


def test_every_code_has_a_break() -> None:
    codes = {code for check in delivery_checks().values() for code in check.codes}
    assert codes == BREAKS.keys() | ELSEWHERE


@pytest.mark.parametrize("code", sorted(BREAKS))
def test_on_a_triangle(tiny: Good, tmp_path: Path, code: str) -> None:
    _break_and_mend(code, tiny, tmp_path)


@pytest.fixture(scope="session")
def sample(tmp_path_factory: pytest.TempPathFactory) -> Good:
    return deliver(tmp_path_factory.mktemp("ada") / "job", SAMPLE / "ada.glb")


@pytest.mark.slow
@pytest.mark.parametrize("code", sorted(BREAKS))
def test_on_the_sample(sample: Good, tmp_path: Path, code: str) -> None:
    _break_and_mend(code, sample, tmp_path)


@pytest.fixture(scope="session")
def ict(tmp_path_factory: pytest.TempPathFactory, shared: Path) -> Good:
    return deliver(tmp_path_factory.mktemp("ict") / "job", shared / SHARED_HEAD)


@pytest.mark.slow
@pytest.mark.parametrize("code", sorted(BREAKS))
def test_on_a_head_of_somebody_else(ict: Good, tmp_path: Path, code: str) -> None:
    _break_and_mend(code, ict, tmp_path)


def _break_and_mend(code: str, good: Good, folder: Path) -> None:
    entry = BREAKS[code]
    for name in ("broken", "mended"):
        (folder / name).mkdir()
    here = folder / "broken"
    assert _found(code, entry.make(good, here, True), here) - entry.also == {code}
    here = folder / "mended"
    assert _found(code, entry.make(good, here, False), here) == set()


def _found(code: str, case: Case, folder: Path) -> set[str]:
    profile = folder / "own.toml"
    needed = any(code in check.codes for id, check in delivery_checks().items() if id == _NODE)
    excluded = "" if needed else f'[exclude]\n{_NODE} = "not what is tested"\n'
    profile.write_text(
        f'schema = "animeme.check-profile/1"\nextends = "delivery"\n{excluded}{case.profile}\n',
        encoding="utf-8",
    )
    report = validate([case.path], profile=str(profile), **case.options)
    asked = {entry.check: entry.reason for entry in report.skipped}
    if needed and _NODE in asked:
        pytest.skip(asked[_NODE])
    return {finding.code for finding in report.all_findings}
