"""How an optional library is installed: from a checkout, or once the package is published."""

from __future__ import annotations

import json
from importlib import metadata

PACKAGE = "skyarm"


def from_index() -> bool:
    """Whether this installation came from a package index: only then does an index know the package's name."""
    try:
        installed = metadata.distribution(PACKAGE)
    except metadata.PackageNotFoundError:
        return False
    # pip writes this file for what it was given as a path or an address (PEP 610), and not for what an index gave it
    told = installed.read_text("direct_url.json")
    if told is None:
        return True
    try:
        return not json.loads(told)
    except ValueError:
        return False


def how_to_install(*extras: str) -> str:
    """The command that installs extras of this package, as it works here."""
    names = ",".join(extras)
    if from_index():
        return f'python -m pip install "{PACKAGE}[{names}]"'
    return f'in the checkout: python -m pip install -e ".[{names}]"'


def needs_extra(extra: str) -> str:
    """What to say where an optional library is missing."""
    return f"needs the extra {extra!r}; {how_to_install(extra)}"
