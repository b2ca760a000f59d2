"""Stability analysis: linearised sampled-data loop and its margins."""

from skyarm.studies.stability.margins import Margins, margins

__all__ = ["Margins", "margins"]
