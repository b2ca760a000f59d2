"""Evidence of stability: the linearised sampled loop with its margins, and maps of what initial states are caught."""

from skyarm.studies.stability.basin import Basin, basin
from skyarm.studies.stability.closed_loop import OpenLoop
from skyarm.studies.stability.margins import Margins, margins
from skyarm.studies.stability.open_loop import open_loop

__all__ = ["Basin", "Margins", "OpenLoop", "basin", "margins", "open_loop"]
