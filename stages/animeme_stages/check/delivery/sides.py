"""Left and right in names of shapes."""

from __future__ import annotations

import re

_SIDES = {"left": "right", "Left": "Right", "LEFT": "RIGHT", "L": "R", "l": "r"}
_OTHER = {**_SIDES, **{right: left for left, right in _SIDES.items()}}
# A letter alone is a side only behind a separator: mouthSmile_L, smile.r; never jaw*L*ower.
_SIDE = re.compile(r"(?P<word>left|right|Left|Right|LEFT|RIGHT)|(?<=[_.\- ])(?P<letter>[LRlr])$")


def mirrored(name: str) -> str:
    """The name of a shape's other side; the same name if it has none.

    >>> mirrored("mouthSmileLeft"), mirrored("smile_R"), mirrored("jawOpen")
    ('mouthSmileRight', 'smile_L', 'jawOpen')
    """
    return _SIDE.sub(lambda match: _OTHER[match[0]], name)
