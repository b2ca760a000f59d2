"""Evidence of stability: the linearised sampled loop with its margins, and maps of what initial states are caught."""

from skyarm.stability.basin import Basin, basin
from skyarm.stability.closed_loop import OpenLoop
from skyarm.stability.margins import Margins, margins
from skyarm.stability.open_loop import open_loop

__all__ = ["Basin", "Margins", "OpenLoop", "basin", "margins", "open_loop"]
