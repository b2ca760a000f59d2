"""Evidence of stability: the linearised sampled loop with its margins."""

from skyarm.studies.stability.closed_loop import OpenLoop
from skyarm.studies.stability.margins import Margins, margins
from skyarm.studies.stability.open_loop import open_loop

__all__ = ["Margins", "OpenLoop", "margins", "open_loop"]
