"""The table of disk margins that ``skyarm margins`` prints: the weakest loop of each group, or every loop."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

HEAD = ("weakest loop", "disk", "gain", "phase", "rad/s", "delay", "together")

NOTE = """\
disk: symmetric disk margin, from 0 (unstable) to 2; gain, phase (deg): what a
loop bears by it, the others as they are; rad/s: where it is most delicate;
delay: dead time of this loop alone that it bears, ms; together: disk margin
of all loops of its kind, each under a factor of its own. The smallest of all
instants."""

GROUPS_ALONE = ("all commands", "all measurements")


def loop_rows(found: Any, *, every: bool) -> list[tuple[str, ...]]:
    """Rows of the table, its head first.

    Args:
        found: evidence of :func:`skyarm.stability.along.evidence`.
        every: every loop in place of the weakest of each group.
    """
    margins = [m for instant in found.instants for m in instant.by_lag.values()]
    alone, several = (
        smallest(each for m in margins for each in m.loops),
        smallest(e for m in margins for e in m.together),
    )
    rows: list[tuple[str, ...]] = [HEAD if not every else ("loop", *HEAD[1:])]
    for group in dict.fromkeys(each.group for each in alone.values()):
        members = [each for each in alone.values() if each.group == group]
        together = several.get(group)
        shown = members if every else [min(members, key=lambda each: float(each.disk))]
        for each in shown:
            last = f"{together.disk:.2f}" if together is not None and each is shown[-1] else ""
            rows.append((*_cells(each), last))
    rows += [(*_cells(several[name]), f"{several[name].disk:.2f}") for name in GROUPS_ALONE if name in several]
    return rows


def smallest(found: Iterable[Any]) -> dict[str, Any]:
    """Of each loop the margin with the smallest disk, by name."""
    least: dict[str, Any] = {}
    for each in found:
        if each.name not in least or each.disk < least[each.name].disk:
            least[each.name] = each
    return least


def _cells(each: Any) -> tuple[str, ...]:
    low, high = each.gain
    gain = f"{low:.2f}-" + ("none" if math.isinf(high) else f"{high:.2f}" if high < 10.0 else f"{high:.1f}")
    frequency = "-" if math.isnan(each.frequency) else f"{each.frequency:.1f}"
    delay = "none" if math.isinf(each.delay) else f"{1e3 * each.delay:.1f}"
    return each.name, f"{each.disk:.2f}", gain, f"{math.degrees(each.phase):.0f}", frequency, delay
