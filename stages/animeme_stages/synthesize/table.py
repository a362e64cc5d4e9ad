"""The table behind `CohenMassaro`: classes of phones, their targets and dominances."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from animeme.curves import Floats
from animeme.phones import SILENCE

Expand = Callable[[str], tuple[str, ...]]

_SIDES = ("Left", "Right")
# ARKit controls that exist once, not per side.
_SINGLE = frozenset(
    {
        "jawOpen",
        "jawForward",
        "mouthClose",
        "mouthFunnel",
        "mouthPucker",
        "mouthRollLower",
        "mouthRollUpper",
        "mouthShrugLower",
        "mouthShrugUpper",
        "tongueOut",
    }
)


def both_sides(control: str) -> tuple[str, ...]:
    """The ARKit controls that a table's name stands for."""
    return (control,) if control in _SINGLE else tuple(f"{control}{side}" for side in _SIDES)


def _as_named(control: str) -> tuple[str, ...]:
    """A fitted table names each control of its dataset in full."""
    return (control,)


@dataclass(frozen=True, eq=False)
class TargetTable:
    """Targets and dominances per class of phones; R classes, G groups, N controls.

    Attributes:
        document: the ``animeme.model/1`` document it was read from.
        controls: names of the N controls.
        groups: names of the G groups of controls that share dominances.
        group_of: (N,) index of each control's group.
        rows: plain IPA symbol → class index.
        targets: (R, N), 0 to 1 unless `fitted`.
        alpha: (R, G), magnitudes of eq. 2.
        contact: (R, N), 1 where the target must be reached exactly, else 0.
        theta_before, theta_after, c: (G,), rates in 1/s^c and exponents of eq. 2.
        releases: class of a stop → class of its release.
        start_peak_rows: classes whose dominance peaks at their start.
        plateau_s, contact_ramp_s, closure_share: see the shipped table.
        fitted: learned from captured motion: targets are in its units, not 0 to 1.
    """

    document: Mapping[str, Any]
    controls: tuple[str, ...]
    groups: tuple[str, ...]
    group_of: Any
    rows: Mapping[str, int]
    targets: Floats
    alpha: Floats
    contact: Floats
    theta_before: Floats
    theta_after: Floats
    c: Floats
    releases: Mapping[int, int]
    start_peak_rows: frozenset[int]
    plateau_s: float
    contact_ramp_s: float
    closure_share: float
    fitted: bool = False
    contact_rows: frozenset[int] = field(init=False)

    def __post_init__(self) -> None:
        reached = np.flatnonzero(self.contact.any(axis=1))
        object.__setattr__(self, "contact_rows", frozenset(int(row) for row in reached))

    def to_document(self) -> dict[str, Any]:
        """The document it was read from."""
        return dict(self.document)

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> TargetTable:
        """Read an ``animeme.model/1`` document of a Cohen–Massaro model.

        Raises:
            ValueError: something is missing or out of range; says what.
        """
        try:
            return cls._read(document)
        except (KeyError, TypeError, AttributeError) as error:
            raise ValueError(f"not a cohen-massaro model: {error!r}") from error

    @classmethod
    def _read(cls, document: Mapping[str, Any]) -> TargetTable:
        groups, classes, config = document["groups"], document["classes"], document["config"]
        fitted = bool(config.get("fitted", False))
        expand = _as_named if fitted else both_sides
        members = [
            (i, side)
            for i, g in enumerate(groups.values())
            for c in g["controls"]
            for side in expand(c)
        ]
        controls = tuple(control for _, control in members)
        names = list(classes)
        rows = {phone: names.index(name) for name in names for phone in classes[name]["phones"]}
        for needed in (SILENCE, "ə"):
            if needed not in rows:
                raise ValueError(f"no class has the phone '{needed}'")
        stops = {
            names.index(n): names.index(c["release"]) for n, c in classes.items() if "release" in c
        }
        table = cls(
            document=document,
            controls=controls,
            groups=tuple(groups),
            group_of=np.array([index for index, _ in members]),
            rows=rows,
            targets=_targets(classes, controls, expand),
            alpha=_alpha(classes, tuple(groups)),
            contact=_contact(classes, controls, groups, expand),
            theta_before=np.array([float(g["theta_before"]) for g in groups.values()]),
            theta_after=np.array([float(g["theta_after"]) for g in groups.values()]),
            c=np.array([float(g["c"]) for g in groups.values()]),
            releases=stops,
            start_peak_rows=frozenset(
                i for i, n in enumerate(names) if classes[n].get("peak") == "start"
            ),
            plateau_s=float(config["plateau_s"]),
            contact_ramp_s=float(config["contact_ramp_s"]),
            closure_share=float(config["closure_share"]),
            fitted=fitted,
        )
        table._require_ranges()
        return table

    def _require_ranges(self) -> None:
        positive = {
            "alpha": self.alpha,
            "theta_before": self.theta_before,
            "theta_after": self.theta_after,
            "contact_ramp_s": np.array(self.contact_ramp_s),
        }
        for name, values in positive.items():
            if not (np.isfinite(values).all() and (values > 0).all()):
                raise ValueError(f"{name} must be positive and finite")
        if not np.isfinite(self.targets).all():
            raise ValueError("targets must be finite")
        if not (self.fitted or ((self.targets >= 0) & (self.targets <= 1)).all()):
            raise ValueError("targets must lie in 0 … 1")
        if not (self.c >= 1).all() or not np.isfinite(self.c).all():
            raise ValueError("c must be at least 1: below it the curve breaks at every peak")
        if not 0 < self.closure_share < 1:
            raise ValueError("closure_share must lie between 0 and 1")
        if not 0 <= self.plateau_s < math.inf:
            raise ValueError("plateau_s must be finite and not negative")


def _targets(classes: Mapping[str, Any], controls: Sequence[str], expand: Expand) -> Floats:
    targets = np.zeros((len(classes), len(controls)))
    for row, entry in enumerate(classes.values()):
        for name, value in entry["targets"].items():
            for control in expand(name):
                if control not in controls:
                    raise ValueError(f"target '{name}' is in no group")
                targets[row, controls.index(control)] = float(value)
    return targets


def _alpha(classes: Mapping[str, Any], groups: tuple[str, ...]) -> Floats:
    return np.array(
        [[float(entry["alpha"][group]) for group in groups] for entry in classes.values()]
    )


def _contact(
    classes: Mapping[str, Any], controls: Sequence[str], groups: Mapping[str, Any], expand: Expand
) -> Floats:
    """(R, N) mask; a contact may name a group or a control."""
    contact = np.zeros((len(classes), len(controls)))
    for row, entry in enumerate(classes.values()):
        for name in entry.get("contact", ()):
            for member in groups[name]["controls"] if name in groups else [name]:
                for control in expand(member):
                    contact[row, controls.index(control)] = 1.0
    return contact
