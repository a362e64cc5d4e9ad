"""Models: fitted to captured motion, kept, compared; import the functions from `animeme`."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from animeme import registry
from animeme.contracts import Model
from animeme.curves import CurveSet
from animeme.dataset import CapturedLine, Dataset, Listener, holdout, no_listener
from animeme.documents import suggestion
from animeme.errors import InputError
from animeme.executors.inline import InlineExecutor
from animeme.executors.local import LocalExecutor
from animeme.files import write_text
from animeme.scoring import Closure, Score, judge


def read_dataset(
    folder: str | Path,
    *,
    language: str = "en",
    aligner: str = "pocketsphinx",
    lexicon: str | Path | None = None,
    rate_hz: float | None = None,
    controls: Sequence[str] = (),
    workers: int = 1,
    listener: Listener = no_listener,
) -> Dataset:
    """Read a folder of ``<id>.<audio>``, ``<id>.txt``, ``<id>.csv`` and perhaps ``<id>.TextGrid``.

    Args:
        folder: the dataset.
        language: BCP-47 tag of what is spoken.
        aligner: a registered aligner, for lines without TextGrid.
        lexicon: pronunciations that go before the aligner's own.
        rate_hz: frames per second, where the CSV files count frames.
        controls: names or patterns (``mouth*``) of the controls to keep; () keeps all.
        workers: processes.
        listener: told of progress.

    Returns:
        The lines that can be used; what was wrong with the others is in its findings.

    Raises:
        InputError: not one line can be used.
    """
    lexicon = Path(lexicon) if lexicon is not None else None
    step = registry.stage("read-dataset")
    given = {
        "language": language, "aligner": aligner, "lexicon": lexicon, "rate_hz": rate_hz,
        "controls": tuple(controls), "listener": listener,
    }  # fmt: skip
    if workers > 1:
        with LocalExecutor(workers) as pool:
            found: Dataset = step(Path(folder), executor=pool, **given)
    else:
        found = step(Path(folder), executor=InlineExecutor(), **given)
    return found


def train(
    dataset: Dataset,
    model: str,
    options: Mapping[str, Any] | None = None,
    *,
    listener: Listener = no_listener,
) -> Model:
    """Fit a model.

    Args:
        dataset: from `read_dataset`.
        model: a registered name.
        options: the model's own, as values or text.
        listener: told of progress.

    Raises:
        PluginError: no such model is registered.
        InputError: an option makes no sense, or there is nothing to learn from.
    """
    return registry.model_type(model).configured(options or {}).fit(dataset, listener=listener)


def save_model(model: Model, path: str | Path) -> None:
    """Write a model's document, which `load_model` and a job's ``[model] file`` take.

    Raises:
        InputError: the file cannot be written.
    """
    text = json.dumps(model.to_document(), ensure_ascii=False, allow_nan=False, indent=None)
    write_text(Path(path), text.replace(", ", ",") + "\n")


def load_model(name_or_file: str | Path) -> Model:
    """A model by name, as shipped, or from a model document.

    Args:
        name_or_file: a registered name, or the path of a model document.

    Raises:
        PluginError: no such model is registered.
        InputError: the document is broken.

    Example:
        >>> import animeme
        >>> model = animeme.load_model("cohen-massaro")
        >>> "jawOpen" in model.controls
        True
    """
    file = _file_of(name_or_file)
    return registry.load_model(None if file else str(name_or_file), file=file)


def _file_of(name_or_file: str | Path) -> Path | None:
    """The file of a model, None if that is a name."""
    path = Path(name_or_file)
    named = path.suffix.lower() in (".json", ".toml", ".animeme")
    return path if named or path.is_file() else None


@dataclass(frozen=True)
class Comparison:
    """How models did on lines they were not fitted to.

    Attributes:
        scores: name as given → score.
        lines: the held-out lines.
        curves: name as given → curves of each of `lines`.
        fitted_lines: how many lines the models were fitted to.
    """

    scores: dict[str, Score]
    lines: tuple[CapturedLine, ...]
    curves: dict[str, list[CurveSet]]
    fitted_lines: int

    def to_json(self) -> dict[str, Any]:
        """As `animeme evaluate --json` prints it."""
        return {"models": {name: score.to_json() for name, score in self.scores.items()}}


def evaluate(
    dataset: Dataset,
    models: Sequence[str],
    *,
    held_out: float = 0.2,
    closure: Closure | None = None,
    listener: Listener = no_listener,
) -> Comparison:
    """Fit models to a part of the lines and judge them by the rest.

    Args:
        dataset: from `read_dataset`.
        models: registered names, each perhaps with options (``dam:degree=0,modes=none``), or files.
            A file is judged as it is; it should not have seen the held-out lines.
        held_out: part of the lines to judge by, more than 0 and less than 1.
        closure: when a mouth counts as closed.
        listener: told of progress.

    Raises:
        PluginError: no such model is registered.
        InputError: a file or an option cannot be used, or there are too few lines.
    """
    if not 0 < held_out < 1:
        raise ValueError(f"held_out must lie between 0 and 1, not {held_out}")
    if len(dataset.lines) < 2:
        raise InputError(
            "dataset-small", "has only one line that can be used", place="dataset",
            action="Add lines: some are fitted, others judged.",
        )  # fmt: skip
    fitted, judged = holdout(dataset, held_out)
    prepared = {name: _prepared(name) for name in models}
    scores, curves = {}, {}
    for name, (model, is_fitted) in prepared.items():
        train_s = None
        if not is_fitted:
            started = time.perf_counter()
            model = model.fit(fitted, listener=_under(name, listener))
            train_s = time.perf_counter() - started
        if not set(model.controls) & set(dataset.controls):
            raise InputError(
                "model-controls",
                f"drives none of the dataset's controls ({', '.join(dataset.controls[:6])} …)",
                place=name,
                action="Train it on this dataset, or give one with its controls.",
            )
        scores[name], curves[name] = judge(model, judged, closure, train_s)
    return Comparison(scores, judged.lines, curves, len(fitted.lines))


def _under(name: str, listener: Listener) -> Listener:
    """A listener that says whose progress it is."""
    return lambda what, part: listener(f"{name} {what}", part)


def _prepared(text: str) -> tuple[Model, bool]:
    """The model that `text` names, and whether it is fitted already."""
    if (file := _file_of(text)) is not None:
        return registry.load_model(file=file), True
    name, options = parse_model(text)
    return registry.model_type(name).configured(options), False


def parse_model(text: str) -> tuple[str, dict[str, str]]:
    """Name and options in ``name:key=value,key=value``.

    Raises:
        InputError: an option has no value.
    """
    name, _, rest = text.partition(":")
    return name, parse_options(rest.split(",") if rest else ())


def parse_options(entries: Sequence[str]) -> dict[str, str]:
    """Options in ``key=value``.

    Raises:
        InputError: one of them has no value.
    """
    found = {}
    for entry in entries:
        key, equals, value = entry.partition("=")
        if not equals or not key.strip():
            raise InputError(
                "model-option", f"'{entry}' is not key=value", place="--set",
                action=suggestion(key, ()) if not key else "Write, for example, degree=4.",
            )  # fmt: skip
        found[key.strip()] = value.strip()
    return found
