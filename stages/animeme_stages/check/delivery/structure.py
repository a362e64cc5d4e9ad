"""What the checks of structure share: foreign judges, and what they said of the source already."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from animeme.delivery import Complaint, complain

GLTF_SUFFIXES = frozenset({".glb", ".gltf", ".vrm"})


@dataclass(frozen=True, order=True)
class Remark:
    """What a foreign judge says of a file.

    Attributes:
        rule: its own name of what is wrong.
        message: in its own words.
        place: JSON pointer or prim path.
    """

    rule: str
    message: str
    place: str


def is_gltf(path: Path) -> bool:
    """Whether a file's name is that of a glTF."""
    return path.suffix.lower() in GLTF_SUFFIXES


def complaints(
    code: str, judge: str, remarks: list[Remark], before: list[Remark], path: Path
) -> Iterator[Complaint]:
    """One complaint for each rule that a file breaks more often than its source did.

    Args:
        code: of the complaints.
        judge: who says so.
        remarks: about the delivered file.
        before: about its source; empty if that is not known.
        path: the delivered file.
    """
    known: Mapping[Remark, int] = Counter(before)
    seen: Counter[Remark] = Counter()
    fresh: dict[str, list[Remark]] = {}
    for remark in remarks:
        seen[remark] += 1
        if seen[remark] > known.get(remark, 0):
            fresh.setdefault(remark.rule, []).append(remark)
    for rule, found in sorted(fresh.items()):
        first = found[0]
        often = f", and {len(found) - 1} more of its kind" if len(found) > 1 else ""
        text = f"{judge}: {rule}: {first.message.rstrip('.')}{often}"
        yield complain(code, text, place=first.place, file=path)
