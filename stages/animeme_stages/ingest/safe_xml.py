"""XML of strangers: no document types, so no entities and nothing fetched; no depth."""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from animeme_stages.ingest.sheets import LARGEST_BYTES, damaged

_DEEPEST = 64


class _RefusedError(Exception):
    """What is in the document is not for us."""


def read_xml(path: Path) -> Element:
    """The root element of a file; names without their namespaces, white space as it is.

    Raises:
        InputError: it is not complete XML, declares a document type, or is too deep or too large.
        OSError: it cannot be read.
    """
    if path.stat().st_size > LARGEST_BYTES:
        damaged(path, f"it is larger than {LARGEST_BYTES >> 20} MiB")
    builder = TreeBuilder()
    depth = 0

    def local(name: str) -> str:
        return name.rpartition("\n")[2]

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > _DEEPEST:
            raise _RefusedError(f"its elements are nested more than {_DEEPEST} deep")
        builder.start(local(tag), {local(name): value for name, value in attributes.items()})

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(local(tag))

    def refuse(*_: object) -> None:
        raise _RefusedError("it declares a document type")

    parser = expat.ParserCreate(namespace_separator="\n")
    parser.StartDoctypeDeclHandler = refuse
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = builder.data
    try:
        parser.Parse(path.read_bytes(), True)
        return builder.close()
    except _RefusedError as error:
        damaged(path, str(error))
    except (expat.ExpatError, ValueError, LookupError) as error:
        damaged(path, f"it is not complete XML ({str(error)[:80]})")
