"""Versions of the packages that a result depends on."""

from __future__ import annotations

import platform
import sys
from functools import lru_cache
from importlib import metadata

ABSENT = "not installed"


def versions(*packages: str) -> dict[str, str]:
    """Versions of Python, of skyarm and of some packages."""
    return {"python": platform.python_version(), **{name: _version(name) for name in ("skyarm", *packages)}}


@lru_cache(maxsize=32)
def _version(package: str) -> str:
    if package == "skyarm":
        # what an editable installation noted once is not the version of the source that runs; not imported, because
        # the package's front reaches every room
        return str(sys.modules["skyarm"].__version__)
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return ABSENT
