"""Engines that need an optional library say so in one sentence."""

from __future__ import annotations


def missing_extra(extra: str) -> ImportError:
    """Error for a library that is not installed; names the extra that brings it."""
    return ImportError(f"needs the extra '{extra}': pip install skyarm[{extra}]")
