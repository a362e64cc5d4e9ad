"""``animeme doctor``: what is installed, what is lacking, and how to get it."""

from __future__ import annotations

import importlib.metadata
import json
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version

import pytest

from support.jobs import Capture, animeme


def _without(missing: str) -> Callable[[str], str]:
    def installed(name: str) -> str:
        if name == missing:
            raise PackageNotFoundError(name)
        return importlib.metadata.version(name)

    return installed


def test_doctor_lists_every_extra_and_plugin(capsys: Capture) -> None:
    ran = animeme(capsys, "doctor", "--json")
    assert ran.code == 0
    found = json.loads(ran.out)
    assert found["animeme"] == version("animeme")
    extras = importlib.metadata.metadata("animeme").get_all("Provides-Extra")
    assert {extra["extra"] for extra in found["extras"]} == set(extras or ())
    assert all(extra["adds"] for extra in found["extras"])
    assert {plugin["problem"] for plugin in found["plugins"]} == {""}
    assert all(found["core"].values())


@pytest.mark.usefixtures("wide")
def test_doctor_says_what_a_missing_extra_adds_and_how_to_get_it(
    capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("animeme.cli.doctor.version", _without("espeakng-loader"))
    found = json.loads(animeme(capsys, "doctor", "--json").out)
    extras = {extra["extra"]: extra for extra in found["extras"]}
    for name in ("espeak", "all"):
        assert extras[name]["installed"] is False
        assert extras[name]["lacking"] == ["espeakng-loader"]

    ran = animeme(capsys, "doctor")
    assert ran.code == 0
    (row,) = [line for line in ran.out.splitlines() if "all but English" in line]
    assert "no" in row.split()
    assert "pip install 'animeme[espeak]'" in row


@pytest.mark.usefixtures("wide")
def test_doctor_says_which_core_package_is_missing(
    capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("animeme.cli.doctor.version", _without("soxr"))
    assert "soxr MISSING" in animeme(capsys, "doctor").out
