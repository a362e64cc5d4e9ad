"""Which rig a job says: shipped, its own file, or refused with the reason."""

from __future__ import annotations

from pathlib import Path

import pytest

from animeme.errors import InputError
from animeme_stages.retarget.profile_files import profile_names
from animeme_stages.retarget.profiles import bind_rig, read_rig
from support.rigs import character

HEAD = 'schema = "animeme.rig/1"\nname = "x"\n[controls]'
BAD_RIGS = {
    "unknown name": ("arkti", None, "rig-not-found", "Did you mean 'arkit'"),
    "file that is not there": ("my.toml", None, "document-unreadable", "no such file"),
    "broken TOML": ("my.toml", "name = ", "document-unreadable", "Invalid value"),
    "another kind": ("my.toml", 'schema = "animeme.job/1"', "document-kind", "animeme.rig/2"),
    "no control": (
        "my.toml",
        HEAD,
        "document-invalid",
        "no control drives",
    ),
    "stray limits": (
        "my.toml",
        HEAD + '\na = [{shape = "s"}]\n[limits]\nt = [0, 1]',
        "document-invalid",
        "nothing drives: t",
    ),
    "inverted limits": (
        "my.toml",
        HEAD + '\na = [{shape = "s"}]\n[limits]\ns = [1, 0]',
        "document-invalid",
        "low above high: s",
    ),
    "misspelt member": (
        "my.toml",
        HEAD + '\na = [{shape = "s", gian = 1}]',
        "document-invalid",
        "Did you mean 'gain'",
    ),
    "gain not a number": (
        "my.toml",
        HEAD + '\na = [{shape = "s", gain = nan}]',
        "document-invalid",
        "controls.a.0.gain",
    ),
}


@pytest.mark.parametrize("case", BAD_RIGS)
def test_a_bad_rig_is_refused_with_its_reason(case: str, tmp_path: Path) -> None:
    rig, content, code, message = BAD_RIGS[case]
    if content is not None:
        (tmp_path / rig).write_text(content, encoding="utf-8")
    with pytest.raises(InputError, match=message) as caught:
        read_rig(rig, tmp_path)
    assert caught.value.code == code


def test_auto_and_shipped_rigs_need_no_file(tmp_path: Path) -> None:
    assert read_rig("auto", tmp_path) is None
    for name in profile_names():
        profile = read_rig(name, tmp_path)
        assert profile is not None
        assert profile.name == name


def test_a_profile_that_shares_no_shape_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="rig-mismatch"):
        bind_rig("arkit", character(["scuttle"]), tmp_path)
