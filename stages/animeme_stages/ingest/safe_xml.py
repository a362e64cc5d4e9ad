"""XML of strangers: no document types, so no entities and nothing fetched; no depth."""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from animeme_stages.ingest.sheets import LARGEST_BYTES, damaged

_DEEPEST = 64


class XmlError(ValueError):
    """Something is no XML that is read here; says why, in words that go after the file's name."""


def read_xml(path: Path) -> Element:
    """The root element of a file; see `parse_xml`.

    Raises:
        InputError: it is not complete XML, declares a document type, or is too deep or too large.
        OSError: it cannot be read.
    """
    if path.stat().st_size > LARGEST_BYTES:
        damaged(path, f"it is larger than {LARGEST_BYTES >> 20} MiB")
    try:
        return parse_xml(path.read_bytes())
    except XmlError as error:
        damaged(path, str(error))


def parse_xml(data: bytes | str) -> Element:
    """The root element of a document; names without their namespaces, white space as it is.

    Args:
        data: as bytes in the encoding that it names, or decoded already.

    Raises:
        XmlError: it is not complete XML, declares a document type, or is too deep.
    """
    builder = TreeBuilder()
    depth = 0

    def local(name: str) -> str:
        return name.rpartition("\n")[2]

    # Expat feeds the tree, so that declarations can be refused before they mean anything.
    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > _DEEPEST:
            raise XmlError(f"its elements are nested more than {_DEEPEST} deep")
        builder.start(local(tag), {local(name): value for name, value in attributes.items()})

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(local(tag))

    def refuse(*_: object) -> None:
        raise XmlError("it has a document type declaration, which is not read")

    # Decoded text has no other encoding, whatever it says of itself.
    decoded = isinstance(data, str)
    parser = expat.ParserCreate("utf-8" if decoded else None, namespace_separator="\n")
    parser.StartDoctypeDeclHandler = refuse
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = builder.data
    try:
        parser.Parse(data.encode("utf-8") if isinstance(data, str) else data, True)
        return builder.close()
    except XmlError:
        raise
    except (expat.ExpatError, ValueError, LookupError) as error:
        raise XmlError(f"it is not complete XML ({str(error)[:80]})") from None
