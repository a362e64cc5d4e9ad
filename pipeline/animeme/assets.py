"""Characters in assets, and assets without what we put into them; import from `animeme`."""

from __future__ import annotations

from pathlib import Path

from animeme import registry
from animeme.rig import Character


def load_character(path: str | Path, *, within: str | Path | None = None) -> Character:
    """The character in an asset: its meshes and their blendshapes.

    Args:
        path: the asset.
        within: folder that the other files it is made of must be in; None for the asset's own. An
            output of animeme refers to its source: there, the folder that holds both.

    Raises:
        InputError: the file is damaged, of no known format, has no blendshapes, or refers to files
            elsewhere.

    Example:
        >>> import animeme
        >>> crab = animeme.load_character("sample_assets/crab.glb")
        >>> len(crab.shapes), "MawGape" in crab.shapes
        (8, True)
    """
    file = Path(path)
    return registry.format_of(file).load(file, within=None if within is None else Path(within))


def strip(path: str | Path, *, output: str | Path | None = None) -> tuple[str, ...]:
    """Take animeme's animations out of an asset: what is left is its source, byte for byte.

    Args:
        path: a file that animeme wrote; its source is not needed.
        output: where to write; None for `path` itself.

    Returns:
        Names of the animations that were taken out.

    Raises:
        InputError: nothing in it is ours, or it was edited since, so that its source cannot be
            promised; nothing is written then.

    Example:
        >>> import animeme
        >>> animeme.strip("out/sample/en/crab.glb", output="crab.glb")[:2]  # doctest: +SKIP
        ('boat', 'count')
    """
    file = Path(path)
    return registry.format_of(file).strip(file, Path(output) if output is not None else file)
