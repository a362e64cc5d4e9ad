"""animeme makes rigged characters speak.

>>> import animeme
>>> animeme.load_character("sample_assets/ada.glb").shapes[:2]
('browDownLeft', 'browDownRight')
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from animeme.api import (
        align,
        align_folder,
        learn_voices,
        load_character,
        load_model,
        review,
        run,
        speak,
        strip,
    )
    from animeme.crossmapping import crossmap
    from animeme.errors import AnimemeError, InputError, JobError, PluginError
    from animeme.selection import Selection, read_changed
    from animeme.training import evaluate, read_dataset, save_model, train

# Loaded when first used, so that `import animeme` and `animeme --help` are quick.
_HOMES = {
    "align": "animeme.api",
    "align_folder": "animeme.api",
    "learn_voices": "animeme.api",
    "load_character": "animeme.api",
    "load_model": "animeme.api",
    "rehearse": "animeme.api",
    "review": "animeme.api",
    "run": "animeme.api",
    "speak": "animeme.api",
    "strip": "animeme.api",
    "crossmap": "animeme.crossmapping",
    "read_changed": "animeme.selection",
    "evaluate": "animeme.training",
    "read_dataset": "animeme.training",
    "save_model": "animeme.training",
    "train": "animeme.training",
    "AnimemeError": "animeme.errors",
    "InputError": "animeme.errors",
    "JobError": "animeme.errors",
    "PluginError": "animeme.errors",
    "Selection": "animeme.selection",
}

__all__ = [
    "AnimemeError",
    "InputError",
    "JobError",
    "PluginError",
    "Selection",
    "align",
    "align_folder",
    "crossmap",
    "evaluate",
    "learn_voices",
    "load_character",
    "load_model",
    "read_changed",
    "read_dataset",
    "rehearse",
    "review",
    "run",
    "save_model",
    "speak",
    "strip",
    "train",
]


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'animeme' has no attribute '{name}'")
