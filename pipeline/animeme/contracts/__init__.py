"""What a plug-in has to offer: models, aligners, formats and checks.

The engine knows none of them by name. Ours are registered through the same entry points as a
studio's, and pass the same suites (`animeme.testing`).
"""

from __future__ import annotations

from animeme.contracts.check import AssetSubject, Check, LineSubject
from animeme.contracts.format import Format, LineAnimation, Verify, unverified
from animeme.contracts.model import Model
from animeme.contracts.speech import (
    Aligner,
    Alignment,
    Anchor,
    LearnedVoice,
    Speech,
    Spoken,
    VoiceLearner,
)

__all__ = [
    "Aligner",
    "Alignment",
    "Anchor",
    "AssetSubject",
    "Check",
    "Format",
    "LearnedVoice",
    "LineAnimation",
    "LineSubject",
    "Model",
    "Speech",
    "Spoken",
    "Verify",
    "VoiceLearner",
    "unverified",
]
