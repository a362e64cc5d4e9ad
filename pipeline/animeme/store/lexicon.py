"""What of a lexicon counts for a line: so that an entry more or less recomputes only its lines."""

from __future__ import annotations

import hashlib
from pathlib import Path

from animeme import registry
from animeme.dialogue import Line, has_transcript, transcript_of
from animeme.errors import InputError
from animeme.store.memory import Memory


class LexiconParts:
    """Parts of one lexicon.

    An aligner with a method ``lexicon_part(text, *, language, lexicon)`` says what of the file
    counts for a text; for any other it is the whole file.

    Attributes:
        state: what every part depends on; "" without a lexicon.

    Args:
        memory: remembers the parts.
        aligner: name of the aligner.
        lexicon: the file, or None.
    """

    def __init__(self, memory: Memory, aligner: str, lexicon: Path | None) -> None:
        self._memory = memory
        self._aligner = aligner
        self.state = ""
        self._lexicon = lexicon
        if lexicon is not None:
            self._digest = memory.digests.of(lexicon)
            code = memory.code.of([registry.find(registry.ALIGNERS, aligner)])
            self.state = f"lexicon:{self._digest}:{code[:16]}"

    def of(self, line: Line, text: str) -> str:
        """What the line's alignment is keyed on.

        Args:
            line: the line.
            text: says what its transcript holds, by digest.
        """
        if self._lexicon is None:
            return ""
        if not has_transcript(line):
            return f"all of {self._digest}"  # the words of its timings are not known here
        key = f"{self.state}:{line.language}:{hashlib.sha256(text.encode()).hexdigest()}"
        noted = self._memory.index.note(key)
        if noted is None:
            noted = self._part(line, self._lexicon)
            self._memory.index.set_note(key, noted)
        return noted

    def _part(self, line: Line, lexicon: Path) -> str:
        part = getattr(registry.aligner(self._aligner), "lexicon_part", None)
        if part is not None:
            try:
                text = transcript_of(line)
                found: str = part(text, language=line.language, lexicon=lexicon)
            except InputError:  # whoever aligns the line will say so
                pass
            else:
                return found
        return f"all of {self._digest}"
