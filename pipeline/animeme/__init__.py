"""animeme makes rigged characters speak.

>>> import animeme
>>> animeme.load_character("sample_assets/ada.glb").shapes[:2]
('browDownLeft', 'browDownRight')
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from animeme.assets import load_character, strip
    from animeme.batch import rehearse, run
    from animeme.crossmapping import crossmap
    from animeme.errors import AnimemeError, InputError, JobError, PluginError
    from animeme.reviewable import review
    from animeme.selection import Selection, read_changed
    from animeme.speech import align, align_folder, learn_voices, speak
    from animeme.training import evaluate, load_model, read_dataset, save_model, train

# Loaded when first used, so that `import animeme` and `animeme --help` are quick.
_HOMES = {
    "load_character": "animeme.assets",
    "strip": "animeme.assets",
    "rehearse": "animeme.batch",
    "run": "animeme.batch",
    "crossmap": "animeme.crossmapping",
    "AnimemeError": "animeme.errors",
    "InputError": "animeme.errors",
    "JobError": "animeme.errors",
    "PluginError": "animeme.errors",
    "review": "animeme.reviewable",
    "Selection": "animeme.selection",
    "read_changed": "animeme.selection",
    "align": "animeme.speech",
    "align_folder": "animeme.speech",
    "learn_voices": "animeme.speech",
    "speak": "animeme.speech",
    "evaluate": "animeme.training",
    "load_model": "animeme.training",
    "read_dataset": "animeme.training",
    "save_model": "animeme.training",
    "train": "animeme.training",
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
