"""The viewer within a page that needs nothing else: no server, no network."""

import json
from typing import Any

from tensegra.viewer.source import part, script, stylesheet

__all__ = ["panel", "viewer_head", "viewer_tail"]


def viewer_head() -> str:
    """Return what a page with viewers has in its head."""
    return f"<style>\n{stylesheet()}</style>"


def viewer_tail() -> str:
    """Return what a page with viewers has at its end: it opens each where its scene stands."""
    opened = part("report")
    return f'<script type="module">\n{script()}\n{opened}</script>'


def panel(content: dict[str, Any], anchor: str, still: str = "") -> str:
    """Return a viewer as HTML for a page that has `viewer_head` and `viewer_tail`.

    Parameters
    ----------
    content
        What `tensegra.viewer.scene` returns.
    anchor
        A name that is unique in the page, of letters, digits and hyphens.
    still
        HTML that is shown where scripts are off.
    """
    # Within a script element only "</" could end it.
    data = json.dumps(content, ensure_ascii=False, allow_nan=False).replace("<", "\\u003c")
    return (
        f'<div data-tensegra-scene="scene-{anchor}">{still}</div>\n'
        f'<script type="application/json" id="scene-{anchor}">{data}</script>'
    )
