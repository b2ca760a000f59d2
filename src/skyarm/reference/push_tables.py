"""``[reference.push]``: the force with which the tip presses on a surface, and what is believed of that surface.

::

    [reference.push]
    force = { kind = "sequence", start = 2, segments = [[1.0, 5.0]] }  # N, a signal; 0 asks for no contact
    normal = [-1, 0, 0]          # world axes, out of the surface; of any length
    speed = 0.1                  # m/s, with which the tip comes; left out: 0.1

A wrong table raises ValueError with one line: field, value, what is allowed.
"""

from __future__ import annotations

from typing import Any

from skyarm.files import Fields, shown
from skyarm.reference.signal_tables import signal_from
from skyarm.reference.tip_push import SPEED, TipPush

SHORTEST = 1e-6
"""Length of a normal below which it points nowhere."""


def push_from(table: Any, where: str) -> TipPush:
    """The wanted contact that a table describes.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    fields = Fields(table, where)
    force = signal_from(fields.take("force"), fields.at("force"))
    normal = fields.vector("normal")
    if sum(c * c for c in normal) < SHORTEST * SHORTEST:
        raise ValueError(f"{fields.at('normal')} = {shown(list(normal))}: must point out of the surface")
    speed = fields.number("speed", SPEED, low=0.0, strict=True)
    fields.done()
    return TipPush(force=force, normal=normal, speed=speed)
