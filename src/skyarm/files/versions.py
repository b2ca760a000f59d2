"""Versions of the packages that a result depends on."""

from __future__ import annotations

import platform
from functools import lru_cache
from importlib import metadata


def versions(*packages: str) -> dict[str, str]:
    """Versions of Python, of skyarm and of some packages."""
    return {"python": platform.python_version(), **{name: _version(name) for name in ("skyarm", *packages)}}


@lru_cache(maxsize=32)
def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "not installed"
