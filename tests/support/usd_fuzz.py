"""Damaged USD files by the thousand, in a process of their own: native code may take it down.

``python -m support.usd_fuzz KIND SEED COUNT FOLDER FIRST`` loads and writes COUNT mutations of a
small character, from the one numbered FIRST on, and prints how they ended. It ends with an error at
the first that is neither written nor refused, takes more than 5 s of CPU time, or leaves a file
behind although it was refused.
"""

from __future__ import annotations

import faulthandler
import random
import re
import resource
import signal
import sys
from collections import Counter
from pathlib import Path

from animeme.errors import InputError
from support.usd_kit import FORMAT, hero, line

PATIENCE_CPU_S = 5.0
PATIENCE_S = 120.0  # of a machine that others use too
MOST_MEMORY = 4 << 30

NUMBERS = ["0", "-1", "1e308", "-1e400", "nan", "inf", "99999999999999999999", "0.1", "(1, 2)"]
WORDS = ["None", "[]", "<>", "</>", "<../..>", "</hero>", '""', "@@", "@./sound.usda@", "true", "}"]
KEYS = [
    "active = false",
    "instanceable = true",
    "prepend references = </hero/rig>",
    "prepend inherits = </hero>",
    "prepend specializes = </hero/face>",
    "prepend payload = @./sound.usda@",
    'variants = { string dialogueLine = "x" }',
    'prepend variantSets = ["dialogueLine", "v"]',
    "hidden = true",
    "kind = 7",
]
TOKEN = re.compile(r"(-?\b\d+(?:\.\d+)?\b)|<[^>]*>|\"[^\"]*\"|\w+(?::\w+)*|[\[\](){}=]")


def mutated_text(text: str, rng: random.Random) -> bytes:
    """`text` with one to three things in it changed."""
    for _ in range(rng.choice((1, 1, 2, 3))):
        kind = rng.choice((0, 1, 2, 3, 3, 4, 4, 5, 5, 6, 7, 8))
        lines = text.splitlines(keepends=True) or [""]
        at = rng.randrange(len(lines))
        tokens = list(TOKEN.finditer(text))
        if kind == 0:
            del lines[at]
            text = "".join(lines)
        elif kind == 1:
            lines.insert(rng.randrange(len(lines)), lines[at])
            text = "".join(lines)
        elif kind == 2:
            text = text[: rng.randrange(len(text) + 1)]
        elif kind == 3:
            # Among a prim's metadata, where most of them mean something.
            heads = [i for i, head in enumerate(lines) if head.rstrip().endswith("(")]
            lines.insert(rng.choice(heads or [at]) + 1, rng.choice(KEYS) + "\n")
            text = "".join(lines)
        elif kind in (4, 5, 6) and tokens:
            numbers = [token for token in tokens if token[1]]
            token = rng.choice(numbers if numbers and kind < 6 else tokens)
            is_number = token in numbers
            new = rng.choice(NUMBERS if is_number else WORDS)
            text = text[: token.start()] + new + text[token.end() :]
        elif kind == 7 and len(tokens) > 1:
            first, second = sorted(rng.sample(tokens, 2), key=lambda token: token.start())
            between = text[first.end() : second.start()]
            swapped = second.group() + between + first.group()
            text = text[: first.start()] + swapped + text[second.end() :]
        elif text:
            where = rng.randrange(len(text))
            text = text[:where] + chr(rng.choice((0, 9, 34, 64, 255, 0x1F642))) + text[where + 1 :]
    return text.encode("utf-8")


def mutated_bytes(data: bytes, rng: random.Random) -> bytes:
    """`data` with some bytes changed, and sometimes cut short."""
    changed = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 8))):
        changed[rng.randrange(len(changed))] = rng.randrange(256)
    return bytes(changed[: rng.randrange(len(data))] if rng.random() < 0.15 else changed)


def attempt(file: Path, target: Path) -> str:
    """Load a character, and write a line for it; how that ended."""
    target.unlink(missing_ok=True)
    try:
        character = FORMAT.load(file)
        FORMAT.write(character, [line("hello", character.shapes)], target)
        FORMAT.read_animations(target)
        FORMAT.harm(character, target)
    except InputError as error:
        refusal = error
    else:
        return "written"
    assert refusal.problem, "an error must say what is wrong"
    assert refusal.action, "an error must say what to do"
    # Reading back may find the written file wanting; before that, there is none.
    assert refusal.place == str(target) or not target.exists(), "a refused asset leaves no file"
    left = [path.name for path in target.parent.iterdir() if path.name.startswith(".")]
    assert left == [], "no temporary file is left"
    return refusal.code


def main() -> None:
    kind, seed, count, name, first = sys.argv[1:]
    folder = Path(name)
    resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    faulthandler.register(signal.SIGPROF, all_threads=False, chain=True)
    old = {0.0: [0.0, 0.5], 5.0: [1.0, 0.5]}
    data = hero(folder / f"sound.{kind}", old=["browUp", "jawOpen"], weights=old).read_bytes()
    (folder / "out").mkdir(exist_ok=True)
    ends: Counter[str] = Counter()
    rng = random.Random(int(seed))
    for number in range(int(count)):
        file = folder / f"fuzz{number}.{kind}"  # USD may still hold the one before
        mutated = mutated_bytes(data, rng) if kind == "usdc" else mutated_text(data.decode(), rng)
        if number < int(first):
            continue
        file.write_bytes(mutated)
        print(f"case {number}", file=sys.stderr, flush=True)
        faulthandler.dump_traceback_later(PATIENCE_S, exit=True)
        signal.setitimer(signal.ITIMER_PROF, PATIENCE_CPU_S)
        ends[attempt(file, folder / "out" / f"out.{kind}")] += 1
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        faulthandler.cancel_dump_traceback_later()
        assert file.read_bytes() == mutated, "the source must not change"
        file.unlink()
    print(dict(ends))


if __name__ == "__main__":
    main()
