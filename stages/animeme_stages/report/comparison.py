"""A plot of captured against modelled curves, as PNG and as HTML that needs nothing else."""

from __future__ import annotations

import html
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from animeme.files import atomic_path, write_text
from animeme.phones import SILENCE
from animeme.training import Comparison
from animeme_stages.pictures import style

# More controls than this make a plot that nobody can read: those that move most are drawn.
MOST_CONTROLS = 6


def plot(compared: Comparison, controls: Sequence[str], path: Path) -> tuple[Path, Path]:
    """Draw the held-out line whose error is nearest to the median.

    Args:
        compared: from `animeme.evaluate`.
        controls: of the dataset.
        path: without suffix, or with one that is replaced.

    Returns:
        The files written: PNG and HTML.

    Raises:
        InputError: they cannot be written.
    """
    # Imported here: it takes a second, and only this needs it.
    import matplotlib

    matplotlib.use("agg")
    with matplotlib.rc_context(style.plot_settings()):
        index = _typical(compared, controls)
        figure = _figure(compared, controls, index)
        png, page = path.with_suffix(".png"), path.with_suffix(".html")
        with atomic_path(png) as scratch:
            figure.savefig(scratch, dpi=110, metadata={"Software": None})
        svg = io.StringIO()
        figure.savefig(svg, format="svg", metadata={"Date": None, "Creator": None})
    write_text(page, _page(compared, controls, index, svg.getvalue()))
    return png, page


def _typical(compared: Comparison, controls: Sequence[str]) -> int:
    """The line whose error, of the first model, is nearest to the median."""
    first = next(iter(compared.curves.values()))
    spread = np.nanstd(np.concatenate([line.values for line in compared.lines]), axis=0)
    errors = []
    for line, curves in zip(compared.lines, first, strict=True):
        known = [i for i, name in enumerate(controls) if name in curves.names and spread[i] > 0]
        columns = [curves.names.index(controls[i]) for i in known]
        off = (curves.sample(line.times_s)[:, columns] - line.values[:, known]) / spread[known]
        finite = off[np.isfinite(off)]
        errors.append(float(np.mean(finite**2)) if len(finite) else np.inf)
    return int(np.argsort(errors, kind="stable")[len(errors) // 2])


def _figure(compared: Comparison, controls: Sequence[str], index: int) -> Any:
    from matplotlib.figure import Figure

    ink, rule = style.hexadecimal(style.INK), style.hexadecimal(style.RULE)
    line = compared.lines[index]
    values = np.concatenate([entry.values for entry in compared.lines])
    spread = np.nan_to_num(np.nanstd(values, axis=0))
    shown = sorted(np.argsort(-spread, kind="stable")[:MOST_CONTROLS].tolist())
    figure = Figure(figsize=(11, 1.2 + 1.7 * len(shown)), layout="constrained")
    axes = np.atleast_1d(figure.subplots(len(shown), 1, sharex=True))
    for axis, column in zip(axes, shown, strict=True):
        axis.plot(
            line.times_s, line.values[:, column], ".-", color=ink, lw=1.6, ms=4, label="captured"
        )
        for name, curves in compared.curves.items():
            if controls[column] in curves[index].names:
                curve = curves[index]
                axis.plot(curve.times_s, curve.curve(controls[column]), lw=1.2, label=name)
        for phone in line.track.phones[1:]:
            axis.axvline(phone.start_s, color=rule, lw=0.6, zorder=0)
        axis.set_ylabel(controls[column])
        axis.margins(x=0)
    for symbol, phone in zip(line.track.ipa(), line.track.phones, strict=True):
        if symbol != SILENCE:
            axes[0].text(
                (phone.start_s + phone.end_s) / 2, 1.02, symbol, ha="center", va="bottom",
                transform=axes[0].get_xaxis_transform(), fontsize=8,
            )  # fmt: skip
    axes[-1].set_xlabel("seconds")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", fontsize=8, ncols=4)
    figure.suptitle(f"{line.id}: captured and modelled", fontsize=11, weight="bold")
    return figure


def _page(compared: Comparison, controls: Sequence[str], index: int, svg: str) -> str:
    drawing = svg[svg.index("<svg") :]
    shown = controls[:MOST_CONTROLS]
    head = "".join(f"<th>{html.escape(name)}</th>" for name in shown)
    rows = []
    for name, score in compared.scores.items():
        errors = [score.rmse[control] for control in shown]
        cells = "".join(f"<td>{'–' if e is None else f'{e:.4f}'}</td>" for e in errors)
        recall = "–" if score.closure_recall is None else f"{score.closure_recall:.1%}"
        rows.append(f"<tr><th>{html.escape(name)}</th>{cells}<td>{recall}</td></tr>")
    return (
        '<!doctype html>\n<html lang="en"><meta charset="utf-8"><title>Models compared</title>\n'
        "<style>body{font:14px sans-serif;margin:2em}td,th{padding:.2em .8em;text-align:right}"
        "svg{max-width:100%;height:auto}</style>\n"
        f"<h1>Models compared on {len(compared.lines)} held-out lines</h1>\n"
        f"<table><tr><th>error (RMSE)</th>{head}<th>bilabials closed</th></tr>\n"
        + "\n".join(rows)
        + f"</table>\n<h2>{html.escape(compared.lines[index].id)}</h2>\n{drawing}\n</html>\n"
    )
