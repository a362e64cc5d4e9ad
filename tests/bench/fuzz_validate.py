"""Every real asset, and damaged copies of the small ones, through `animeme validate`.

    python tests/bench/fuzz_validate.py ../shared [--seed 1] [--count 400] [--patience-s 20]

Each file is judged in a process that is replaced when native code takes it down, or when a file
takes longer than the patience. Prints what was found, and the seed and number of every file that
ended in anything but findings or a refusal; exits with 1 if there is one.
"""

from __future__ import annotations

import argparse
import multiprocessing
import random
import tempfile
from collections import Counter
from multiprocessing.connection import Connection
from pathlib import Path

from animeme.errors import AnimemeError

SUFFIXES = (".glb", ".gltf", ".vrm", ".usd", ".usda", ".usdc", ".usdz")
SMALL_BYTES = 400_000
LARGE_BYTES = 30_000_000


def main() -> int:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("shared", type=Path)
    arguments.add_argument("--seed", type=int, default=1)
    arguments.add_argument("--first", type=int, default=0)
    arguments.add_argument("--count", type=int, default=400)
    arguments.add_argument("--patience-s", type=float, default=20.0)
    given = arguments.parse_args()
    files = sorted(
        path
        for path in (given.shared / "assets").rglob("*")
        if path.suffix.lower() in SUFFIXES and path.stat().st_size < LARGE_BYTES
    )
    judge = Judge(given.patience_s)
    found: Counter[str] = Counter()
    wrong: list[str] = []

    def note(name: str, answer: str) -> None:
        if answer.startswith("bad: "):
            wrong.append(f"{name}: {answer}")
        else:
            found.update(answer.split() or ["nothing"])

    for file in files if not given.first else ():
        note(str(file), judge.ask(file))
    print(f"{len(files)} files as they are: {dict(found)}")
    found.clear()
    small = [file for file in files if file.stat().st_size < SMALL_BYTES]
    with tempfile.TemporaryDirectory() as folder:
        for number in range(given.first, given.first + given.count):
            chance = random.Random(f"{given.seed} {number}")
            file = chance.choice(small)
            target = Path(folder) / f"{number}{file.suffix}"
            target.write_bytes(damaged(file.read_bytes(), chance))
            note(f"--seed {given.seed} --first {number} --count 1 ({file.name})", judge.ask(target))
            target.unlink()
    print(f"{given.count} damaged copies: {dict(found.most_common())}")
    print("\n".join(wrong) or "none hung, crashed or ended in a traceback")
    return 1 if wrong else 0


def damaged(content: bytes, chance: random.Random) -> bytes:
    """Some bytes changed, lost, doubled, or the end cut off."""
    data = bytearray(content)
    for _ in range(chance.choice((1, 3, 20))):
        at, kind = chance.randrange(len(data)), chance.random()
        if kind < 0.7:
            data[at] = chance.randrange(256)
        elif kind < 0.8:
            del data[at : at + chance.randrange(1, 50)]
        elif kind < 0.9:
            data[at:at] = data[at : at + chance.randrange(1, 50)]
        elif len(data) > 100:
            del data[max(at, 50) :]
    return bytes(data)


class Judge:
    """A process that judges, and another when that is gone."""

    def __init__(self, patience_s: float) -> None:
        self._patience_s = patience_s
        self._start()

    def ask(self, file: Path) -> str:
        """Codes of what is found; after "bad: " what ought not to happen."""
        self._pipe.send(file)
        try:
            if self._pipe.poll(self._patience_s):
                return str(self._pipe.recv())
            answer = f"bad: hung for {self._patience_s:g} s"
        except EOFError:
            self._process.join()
            answer = f"bad: crashed with {self._process.exitcode}"
        self._process.kill()
        self._start()
        return answer

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, other = context.Pipe()
        self._process = context.Process(target=serve, args=(other,), daemon=True)
        self._process.start()
        other.close()


def serve(pipe: Connection) -> None:
    """Judge whatever is asked."""
    from animeme.validation import validate

    while True:
        try:
            file = pipe.recv()
        except EOFError:
            return
        try:
            findings = validate([file]).all_findings
            faults = [finding for finding in findings if finding.ours]
            codes = " ".join(sorted({finding.code for finding in findings}))
            pipe.send(f"bad: {faults[0].message}" if faults else codes)
        except AnimemeError as error:
            pipe.send(f"bad: refused: {error}")
        except Exception as error:  # noqa: BLE001  that is what is looked for
            pipe.send(f"bad: {type(error).__name__}: {error}")


if __name__ == "__main__":
    raise SystemExit(main())
