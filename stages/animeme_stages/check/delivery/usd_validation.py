"""Check ``usd-validation``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, ClassVar

from animeme.delivery import Code, Complaint, Delivery, LimitSpec, Skip
from animeme.findings import Severity
from animeme_stages.check.delivery.structure import Remark, complaints, is_gltf


class UsdValidationCheck:
    """OpenUSD's own validators find no error."""

    id: ClassVar[str] = "usd-validation"
    subject: ClassVar[str] = "delivery"
    rationale: ClassVar[str] = (
        "They know the schemas: a skeleton that is bound wrongly composes without a word, and "
        "stands still."
    )
    source: ClassVar[str] = "OpenUSD, UsdValidation framework, the validators that usd-core brings"
    codes: ClassVar[Mapping[str, Code]] = {
        "usd-invalid": Code(
            Severity.WARNING,
            "A validator of OpenUSD finds an error that the source, if known, has not.",
            "Look at the prim with usdview, and export the file anew.",
        ),
    }
    limits: ClassVar[Mapping[str, LimitSpec]] = {}

    def run(self, delivery: Delivery, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain of each rule that is broken, once."""
        if is_gltf(delivery.path):
            raise Skip("the file is no USD")
        found = _remarks(delivery.path)
        before = _of_source(delivery.source.source) if delivery.source is not None else []
        yield from complaints("usd-invalid", "UsdValidation", found, before, delivery.path)


def _of_source(path: Path) -> list[Remark]:
    now = path.stat()
    return [] if is_gltf(path) else _kept(path, now.st_size, now.st_mtime_ns)


@lru_cache(maxsize=8)
def _kept(path: Path, size: int, changed_ns: int) -> list[Remark]:
    """Of a source that many files were made from, as long as it stays as it is."""
    return _remarks(path)


def _remarks(path: Path) -> list[Remark]:
    """Every error of every validator."""
    from pxr import Tf, Usd, UsdValidation  # takes its time, and every worker loads the checks

    try:
        stage = Usd.Stage.Open(str(path))
    except Tf.ErrorException as error:
        return [Remark("Stage", str(error).splitlines()[0], "")]
    registry = UsdValidation.ValidationRegistry()
    context = UsdValidation.ValidationContext(registry.GetOrLoadAllValidators())
    return [
        Remark(
            str(error.GetName()), str(error.GetMessage()).replace(str(path.resolve()), path.name),
            next((str(s.GetPrim().GetPath()) for s in error.GetSites() if s.IsPrim()), ""),
        )
        for error in context.Validate(stage)
        if error.GetType() == UsdValidation.ValidationErrorType.Error
    ]  # fmt: skip
