"""The shipped profiles of checks: which run, and with what thresholds, as data."""

from __future__ import annotations

from pathlib import Path

_FOLDER = Path(__file__).parent


def delivery() -> Path:
    """What every delivery should pass."""
    return _FOLDER / "delivery.toml"


def strict() -> Path:
    """As little as possible is let through."""
    return _FOLDER / "strict.toml"


def engine_unreal() -> Path:
    """For Unreal Engine."""
    return _FOLDER / "engine-unreal.toml"


def engine_unity() -> Path:
    """For Unity."""
    return _FOLDER / "engine-unity.toml"


def vrm() -> Path:
    """For VRM avatars."""
    return _FOLDER / "vrm.toml"


def usd() -> Path:
    """For USD pipelines."""
    return _FOLDER / "usd.toml"
