"""Records in a notebook: what a command prints about one, and a picture."""

from __future__ import annotations

import html
from importlib import import_module

PAGE = "skyarm.cli.notebook"
"""Module of the words and pictures: a room above this one, imported when a notebook shows a record, by name only."""


def notebook_html(record: object) -> str:
    """HTML of a record for a notebook; its text alone where more cannot be made."""
    try:
        words, picture = import_module(PAGE).words_and_picture(record)
    except Exception:  # a cell shows what there is: a damaged log, a plugin that is not loaded
        words, picture = repr(record), ""
    return f"<pre>{html.escape(words)}</pre>{picture}"
