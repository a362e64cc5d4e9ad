"""Pages as text: what they carry, and a policy that lets them do nothing else."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Sequence
from functools import cache
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any
from urllib.parse import quote

# In this order they make one script; each may use what is above it.
_SCRIPTS = (
    "dom.js", "marks.js", "curves.js", "clock.js", "drawing.js", "lanes.js", "heads.js",
    "panels.js", "line.js", "index.js", "main.js",
)  # fmt: skip
HEAD = "head.bundle.js"


def _page_file(name: str) -> str:
    return files("animeme_stages.review").joinpath("page", name).read_text(encoding="utf-8")


@cache
def script() -> str:
    """All of our code, as one classic script."""
    parts = "\n".join(_page_file(name) for name in _SCRIPTS)
    return f'(() => {{\n"use strict";\n{parts}\n}})();\n'


@cache
def style() -> str:
    """The style sheet."""
    return _page_file("page.css")


@cache
def head_script() -> str | None:
    """The bundle of the 3D view; None where it was not built."""
    try:
        return _page_file(HEAD)
    except FileNotFoundError:
        return None


def as_json(value: Any) -> str:
    """JSON that HTML cannot mistake for anything else."""
    text = json.dumps(value, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def asset_script(digest: str, about: Any, glb_gz: bytes) -> str:
    """A viewing copy as a script, for pages from disk can read nothing else."""
    entry = {**about, "glb": base64.b64encode(glb_gz).decode()}
    return f"(globalThis.animemeAssets ??= {{}})[{as_json(digest)}] = {as_json(entry)};\n"


def page(
    title: str,
    data: Any,
    *,
    scripts: Sequence[str | Path],
    style: str | Path,
    language: str = "en",
) -> str:
    """A whole page.

    Args:
        title: of the window.
        data: what the script finds in the element ``data``.
        scripts: code to hold, or files to refer to, in order.
        style: likewise.
        language: BCP-47 tag of the page itself.
    """
    told = as_json(data)
    # Whoever wrote a transcript cannot know the digest of what it is in: no text of theirs runs.
    digest = hashlib.sha256((title + told).encode("utf-8", "surrogatepass")).digest()
    nonce = base64.b64encode(digest[:18]).decode()
    policy = (
        f"default-src 'none'; script-src 'nonce-{nonce}' 'wasm-unsafe-eval'; "
        f"style-src 'nonce-{nonce}'; img-src data: blob:; media-src 'self' file: data: blob:; "
        "connect-src data: blob:; base-uri 'none'; form-action 'none'"
    )
    sheet = (
        f'<link rel="stylesheet" nonce="{nonce}" href="{_href(style)}">'
        if isinstance(style, Path)
        else f'<style nonce="{nonce}">{style}</style>'
    )
    code = "\n".join(_script(entry, nonce) for entry in scripts)
    return f"""<!doctype html>
<html lang="{escape(language)}">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{escape(policy)}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<meta name="referrer" content="no-referrer">
<link rel="icon" href="data:,">
<title>{escape(title)}</title>
{sheet}
</head>
<body>
<div id="app"><noscript>This page shows animation, and needs JavaScript to do so.</noscript></div>
<script type="application/json" id="data">{told}</script>
{code}
</body>
</html>
"""


def _href(path: Path) -> str:
    return escape(quote(path.as_posix()))


def _script(entry: str | Path, nonce: str) -> str:
    if isinstance(entry, Path):
        return f'<script nonce="{nonce}" defer src="{_href(entry)}"></script>'
    # In code, "</script" stands in strings and regular expressions only.
    code = entry.replace("</script", "<\\/script").replace("<!--", "<\\!--")
    return f'<script nonce="{nonce}">{code}</script>'
