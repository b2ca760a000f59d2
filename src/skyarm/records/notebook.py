"""Display of a record in a notebook: the text that a command prints about the record,
and a picture.
"""

from __future__ import annotations

from importlib import import_module

PAGE = "skyarm.cli.notebook"
"""Name of the module that formats records for notebooks; imported only when a notebook
shows a record."""


def notebook_html(record: object) -> str:
    """HTML of a record for a notebook; only the record's text if nothing more can be
    displayed.
    """
    import html  # at a cell, not at each command

    try:
        words, picture = import_module(PAGE).words_and_picture(record)
    except Exception:
        # a cell shows what there is: a damaged log, a plugin that is not loaded
        words, picture = repr(record), ""
    return f"<pre>{html.escape(words)}</pre>{picture}"
