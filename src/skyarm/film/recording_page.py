"""The page that plays recordings: viser's player, alone or with a recording in it, from no other place."""

from __future__ import annotations

import base64
import json
from html import escape
from pathlib import Path
from typing import Any
from urllib.parse import quote

from skyarm.files import needs_extra


def player_page(recording: str | None = None) -> str:
    """The player as one page: it plays the file that ``?playbackPath=`` names, or else ``recording``.

    For a site that shows several recordings: one player, and a frame ``player.html?playbackPath=FILE.viser`` for each.
    Both must be served; a page opened as a file may read no other file (:func:`page_with` needs none).
    """
    page = _client()
    if recording is None:
        return page
    script = (
        "<script>{const words=new URLSearchParams(location.search);if(!words.has('playbackPath')){"
        f"words.set('playbackPath',{json.dumps(recording)});history.replaceState(null,'','?'+words)}}}}</script>"
    )
    return page.replace("</head>", f"{script}</head>", 1)


def recording_frame(player: str, recording: str, title: str, *, height: int = 420) -> str:
    """The HTML of a frame in which a page shows a recording.

    Args:
        player: address of the player's page, from the page that shows it.
        recording: address of the ``.viser`` file, from the player's page.
        title: what is shown, for those who do not see it.
        height: pixels.
    """
    address = f"{player}?playbackPath={quote(recording)}"
    look = f"width:100%;height:{height}px;border:1px solid #d0d4da"
    return f'<iframe src="{escape(address)}" title="{escape(title)}" loading="lazy" style="{look}"></iframe>'


def page_with(content: bytes) -> str:
    """The player and a recording in one page, which plays when opened as a file, too."""
    held = base64.b64encode(content).decode("ascii")
    script = f'<script>window.__VISER_EMBED_DATA__="{held}";window.__VISER_EMBED_CONFIG__={{darkMode:false}};</script>'
    return _client().replace("</head>", f"{script}</head>", 1)


def import_viser() -> Any:
    """The library of recordings.

    Raises:
        ValueError: it is missing.
    """
    try:
        import viser
    except ImportError:
        raise ValueError(f"viser: is missing; a recording {needs_extra('studio')}") from None
    return viser


def _client() -> str:
    """The player's page, which comes with viser."""
    return (Path(import_viser().__file__).parent / "client" / "build" / "index.html").read_text("utf-8")
