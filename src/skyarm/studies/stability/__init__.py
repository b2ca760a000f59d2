"""Evidence of stability: the linearised sampled loop with its margins."""

from skyarm.studies.stability.margins import Margins, margins

__all__ = ["Margins", "margins"]
