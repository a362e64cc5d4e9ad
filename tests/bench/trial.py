"""200 files that animeme delivers, judged as they are and with one damage each.

    PYTHONPATH=tests python tests/bench/trial.py ../shared [--seed 1] [--folder DIR]

Lines of GRID on the sample's two heads and the ICT head, and prompts in three languages on the
sample's head, as glTF and USD, in every layout. Which lines they are, and which damage a file gets
(see damaged_files.py and damaged_motion.py), comes from the seed. Prints what is found of sound
files, how many damages are found under a right code, and which are missed.
"""

from __future__ import annotations

import argparse
import json
import random
import shutil
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import animeme
from animeme.findings import Severity
from animeme.validation import ValidationReport, validate
from bench import damaged_files, damaged_motion
from bench.damage_kinds import Output, Unsuitable
from bench.damaged_files import moved_name

KINDS = {**damaged_files.KINDS, **damaged_motion.KINDS}
SAMPLE = Path(__file__).parents[2] / "sample_assets"
LANGUAGES = ("en", "es", "fr")
NAMES = ("ada", "crab", "ict", "clip", "whole", "localised")
Json = dict[str, Any]


@dataclass(frozen=True)
class Character:
    """A character of the trial, delivered and judged on its own.

    Attributes:
        sources: its files.
        rig: as in a job.
        layout: as in a job.
    """

    sources: tuple[Path, ...]
    rig: str
    layout: str


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("shared", type=Path)
    arguments.add_argument("--seed", type=int, default=1)
    arguments.add_argument("--folder", type=Path, help="keep everything here, and go on from there")
    arguments.add_argument("--only", nargs="*", choices=NAMES, default=NAMES)
    given = arguments.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = given.folder or Path(scratch)
        for name, (character, recordings) in trials(given.shared, given.seed).items():
            here = folder / name
            if name in given.only and not (here / "result.json").exists():
                character = deliver(name, character, recordings, here)
                result = {
                    "sound": sound(judged(character, here / "out")),
                    "damaged": damaged(character, here, random.Random(f"{given.seed} {name}")),
                }
                text = json.dumps(result, indent=1)
                (here / "result.json").write_text(text, encoding="utf-8")
        print_table([json.loads(p.read_text()) for p in sorted(folder.glob("*/result.json"))])


def trials(shared: Path, seed: int) -> dict[str, tuple[Character, list[tuple[str, Path]]]]:
    """Name → character, and what it says: language and recording."""
    chance = random.Random(seed)
    ict = shared / "assets" / "ict" / "ict_multimesh_speech"
    ict_glb, ict_usd = ict.with_suffix(".glb"), ict.with_suffix(".usdc")
    ada = (SAMPLE / "ada.glb", SAMPLE / "ada.usdc")
    crab = (SAMPLE / "crab.glb", SAMPLE / "crab.usdc")
    grid = sorted((shared / "data" / "grid-s1" / "lines").glob("*.flac"))
    prompts = shared / "data" / "prompts" / "vo"
    names = sorted(
        path.name
        for path in (prompts / "en").glob("*.flac")
        if all((prompts / language / path.name).is_file() for language in LANGUAGES)
    )
    spoken = [("en", path) for path in chance.sample(grid, 36)]
    prompted = [
        (language, prompts / language / name)
        for name in chance.sample(names, 5)
        for language in LANGUAGES
    ]
    crab_rig = str(SAMPLE / "crab.rig.toml")
    found = (
        (Character(ada, "auto", "per-line"), spoken),
        (Character(crab, crab_rig, "per-line"), spoken[:30]),
        (Character((ict_glb, ict_usd), "auto", "per-character"), spoken[:6]),
        (Character((ict_glb,), "auto", "animation-only"), spoken[:30]),
        (Character(ada, "auto", "per-character"), prompted),
        (Character(ada, "auto", "per-line"), prompted),
    )
    return dict(zip(NAMES, found, strict=True))


def deliver(
    name: str, character: Character, recordings: list[tuple[str, Path]], here: Path
) -> Character:
    """Run the job of one character in a folder; gives it with its sources there."""
    for language, recording in recordings:
        (here / "dialogue" / language).mkdir(parents=True, exist_ok=True)
        for suffix in (recording.suffix, ".txt"):
            target = here / "dialogue" / language / f"{recording.stem}{suffix}"
            shutil.copyfile(recording.with_suffix(suffix), target)
    (here / "sources").mkdir(exist_ok=True)
    sources = tuple(
        Path(shutil.copy(source, here / "sources" / f"{name}{source.suffix}"))
        for source in character.sources
    )
    listed = ", ".join(f'"sources/{source.name}"' for source in sources)
    (here / "job.toml").write_text(
        f'[job]\nname = "{name}"\noutput = "out"\n[dialogue]\nroot = "dialogue"\n'
        f'[characters.{name}]\nasset = [{listed}]\nrig = "{character.rig}"\n'
        f'layout = "{character.layout}"\n',
        encoding="utf-8",
    )
    animeme.run(here / "job.toml", executor="inline")
    # The layers that join languages hold no lines of their own.
    for joined in (here / "out").glob("*.usda"):
        joined.unlink()
    return replace(character, sources=sources)


def judged(character: Character, delivery: Path) -> ValidationReport:
    """As somebody who gets the delivery would."""
    return validate(
        [delivery],
        dialogue=delivery.parent / "dialogue",
        against=delivery.parent / "sources",
        rig=character.rig,
    )


def sound(report: ValidationReport) -> Json:
    """What is found of sound files."""
    return {
        "files": len(report.files),
        "flagged": len({f.file for f in report.all_findings}),
        "errors": sum(f.severity is Severity.ERROR for f in report.all_findings),
        "findings": [f"{Path(f.file).name} {f.line} {f}" for f in report.all_findings],
    }


def damaged(character: Character, here: Path, chance: random.Random) -> list[Json]:
    """Per file: kind of damage, file, whether a right code was found, all codes."""
    delivery, target_of = here / "out", here / "damaged"
    languages = [language for language in LANGUAGES if (delivery / language).is_dir()]
    files = sorted(file for file in delivery.rglob("*") if file.suffix in (".glb", ".usdc"))
    chosen: dict[Path, str] = {}
    bag: list[str] = []
    for file in files:
        same = [f for f in files if f.parent == file.parent and f.suffix == file.suffix]
        source = next(s for s in character.sources if s.suffix == file.suffix)
        output = Output(file, source, character.layout, [f for f in same if f != file], languages)
        target = target_of / file.relative_to(delivery)
        target.parent.mkdir(parents=True, exist_ok=True)
        # Every kind comes once before any comes again.
        bag = bag or chance.sample(sorted(KINDS), len(KINDS))
        for kind in (*bag, *chance.sample(sorted(KINDS), len(KINDS))):
            try:
                KINDS[kind].apply(output, target, chance)
            except Unsuitable:
                target.unlink(missing_ok=True)
                continue
            if kind in bag:
                bag.remove(kind)
            chosen[target] = kind
            break
    report = judged(character, target_of)
    return [_tried(target, kind, report, here.name) for target, kind in chosen.items()]


def _tried(target: Path, kind: str, report: ValidationReport, character: str) -> Json:
    """Whether what is found of a file, or of its line where there is none, is right."""
    own = (str(target), str(moved_name(target)))
    codes = {
        finding.code
        for finding in report.all_findings
        if (finding.file in own or Path(finding.file).name == moved_name(target).name)
        or (not finding.file and target.stem in (finding.line.partition("/")[2], character))
    }
    where = "/".join(target.parts[-3:])
    hit = bool(codes & KINDS[kind].codes)
    return {"kind": kind, "file": where, "hit": hit, "codes": sorted(codes)}


def print_table(results: list[Json]) -> None:
    """What is found of sound files, and how many damages of each kind."""
    files, flagged, errors = (
        sum(r["sound"][key] for r in results) for key in ("files", "flagged", "errors")
    )
    print(f"{files} sound files: {flagged} with a finding ({flagged / files:.1%}), {errors} errors")
    for finding in (finding for result in results for finding in result["sound"]["findings"]):
        print(f"    {finding[:160]}")
    tried = [entry for result in results for entry in result["damaged"]]
    hits = [entry["kind"] for entry in tried if entry["hit"]]
    share = len(hits) / len(tried)
    print(f"{len(tried)} damaged files: {len(hits)} found under a right code ({share:.1%})")
    for kind in KINDS:
        print(f"    {hits.count(kind):3} of {[e['kind'] for e in tried].count(kind):3}  {kind}")
    for entry in tried:
        if not entry["hit"]:
            print(f"    missed: {entry['kind']}: {entry['file']}: {' '.join(entry['codes'])}")


if __name__ == "__main__":
    main()
