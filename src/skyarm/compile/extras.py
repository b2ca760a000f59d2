"""Engines that need an optional library say so in one sentence."""

from __future__ import annotations

from skyarm.files import needs_extra


def missing_extra(extra: str) -> ImportError:
    """Error for a library that is not installed; names the extra that brings it."""
    return ImportError(needs_extra(extra))
