"""Make the shipped sets of bigrams, from the untrained Cohen–Massaro model.

Run ``python tests/bench/shipped_bigrams.py``. The Mandarin set extends the English one by the pairs
with the class that it adds (2013 paper, section 4.4).
"""

from __future__ import annotations

from pathlib import Path

from animeme.bigrams import save_bigrams, seed_bigrams

FOLDER = Path(__file__).parents[2] / "stages" / "animeme_stages" / "synthesize" / "bigram_sets"
SOURCE = "animeme: seeded from its untrained cohen-massaro model"


def main() -> None:
    """Write both sets and print how near they come to their model."""
    for poses, name, base in (
        ("facefx-poses", "facefx", "facefx-poses"),
        ("mandarin-poses", "mandarin", "facefx"),
    ):
        found = seed_bigrams("cohen-massaro", poses=poses)
        pairs = found.document["pairs"]
        document = {**found.document, "name": name, "extends": base, "source": SOURCE}
        if base == "facefx":
            pairs = {pair: entry for pair, entry in pairs.items() if "yu" in pair.split("|")}
            document |= {"source": "", "phones": {"yu": ["y", "ɥ", "ʏ"]}}
        save_bigrams({**document, "licence": "MIT", "pairs": pairs}, FOLDER / f"{name}.json")
        print(name, len(pairs), "pairs")
        for control, error in found.rmse.items():
            print(f"  {control:20} {error:.4f} {found.correlation[control]}")


if __name__ == "__main__":
    main()
