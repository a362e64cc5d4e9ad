"""Check ``gltf-readers``."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from animeme.delivery import Code, Complaint, Delivery, LimitSpec, Skip, complain
from animeme.findings import Severity
from animeme_stages.check.delivery.structure import is_gltf

if TYPE_CHECKING:
    from pygltflib import GLTF2


class GltfReaders:
    """A reader that is not ours takes the file too."""

    id: ClassVar[str] = "gltf-readers"
    subject: ClassVar[str] = "delivery"
    rationale: ClassVar[str] = (
        "What one reader forgives another refuses: a file is delivered to programs that nobody "
        "here has seen."
    )
    source: ClassVar[str] = "pygltflib 1.16, and glTF 2.0 specification, section 3.6: buffer views"
    codes: ClassVar[Mapping[str, Code]] = {
        "gltf-refused": Code(
            Severity.ERROR,
            "pygltflib cannot read the file, or data that it refers to is not there.",
            "Export it anew; the Khronos glTF validator says more.",
        ),
    }
    limits: ClassVar[Mapping[str, LimitSpec]] = {}

    def run(self, delivery: Delivery, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain once: of the first thing that cannot be followed."""
        if not is_gltf(delivery.path):
            raise Skip("the file is no glTF")
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                document = _read(delivery.path)
            if document is None:
                raise ValueError("it reads nothing")
            wrong = _beyond(document)
        except Exception as error:  # noqa: BLE001  whatever it raises, it did not take the file
            wrong = f"{type(error).__name__}: {error}", ""
        if wrong is not None:
            said, place = wrong
            yield complain("gltf-refused", f"pygltflib: {said}", place=place)


def _read(path: Path) -> GLTF2 | None:
    """Either form, told by its first bytes: it goes by suffixes, and knows no ``.vrm``."""
    from pygltflib import GLTF2  # takes its time, and every worker loads the checks

    with path.open("rb") as stream:
        binary = stream.read(4) == b"glTF"
    document = GLTF2()
    return document.load_binary(str(path)) if binary else document.load_json(str(path))


def _beyond(document: GLTF2) -> tuple[str, str] | None:
    """What refers to more than there is, and where."""
    sizes = [buffer.byteLength for buffer in document.buffers]
    blob = document.binary_blob() if sizes and document.buffers[0].uri is None else None
    if blob is not None and len(blob) < sizes[0]:
        return f"buffer 0 has {len(blob)} of its {sizes[0]} bytes", "/buffers/0"
    for index, view in enumerate(document.bufferViews):
        place = f"/bufferViews/{index}"
        if not 0 <= (view.buffer or 0) < len(sizes):
            return f"there is no buffer {view.buffer}", f"{place}/buffer"
        if (view.byteOffset or 0) + view.byteLength > sizes[view.buffer or 0]:
            return "goes beyond its buffer", place
    for index, accessor in enumerate(document.accessors):
        if accessor.bufferView is not None and accessor.bufferView >= len(document.bufferViews):
            return f"there is no buffer view {accessor.bufferView}", f"/accessors/{index}"
    return None
