"""Derived numbers of a study: several paths follow one named number by expressions.

    [vary]
    arm = { uniform = [0.10, 0.20] }                              # a name of one's own: a word without a dot

    [derived]
    "plant.vehicle.links.1.joint.position.z" = "-arm"             # flown
    "plant.vehicle.links.0.body.com.z" = "-arm / 2"
    reach = "2 * arm"                                             # only written into the rows

An expression may use what varies and what is derived above it.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.files import Fields, shown
from skyarm.sweep.expressions import FUNCTION, Expression, read_expression

Array = npt.NDArray[np.float64]

NAME = re.compile(r"[A-Za-z_]\w*", re.ASCII)
"""A number of the study's own; every path of a scenario has a dot."""

MOST_DERIVED = 1000


def is_own_name(text: str) -> bool:
    """Whether this names a number of the study's own, not one of its scenario."""
    return NAME.fullmatch(text) is not None


def derived_from(table: Any, varied: Collection[str], where: str = "derived") -> dict[str, Expression]:
    """Read the expressions of a table, in its order.

    Args:
        table: path or name -> expression.
        varied: names and paths under ``vary``.
        where: what messages call the table.

    Raises:
        ValueError: one line: an expression that cannot be read, or a number that varies already.
    """
    fields = Fields(table, where)
    if len(fields.table) > MOST_DERIVED:
        raise ValueError(f"{where} = {len(fields.table)} numbers: must be at most {MOST_DERIVED}")
    found: dict[str, Expression] = {}
    for name, text in fields.table.items():
        at = f'{where}."{name}"'
        if name in varied:
            raise ValueError(f"{at} = {shown(text)}: must not be under vary as well")
        if name == FUNCTION:
            raise ValueError(f"{at} = {shown(text)}: must have another name than the function {FUNCTION}")
        found[name] = read_expression(text, (*varied, *found), at)
    return found


def require_used(varied: Collection[str], derived: Mapping[str, Expression]) -> None:
    """Refuse names under ``vary`` that no expression uses.

    Raises:
        ValueError: one line.
    """
    used = {name for each in derived.values() for name in each.names}
    for name in varied:
        if derived and is_own_name(name) and name not in used:
            raise ValueError(f'vary."{name}": must be a path, or be used by an expression under derived')


def with_derived(drawn: Mapping[str, Array], derived: Mapping[str, Expression]) -> dict[str, Array]:
    """Numbers of episodes, each (episodes,), with those that are derived from them.

    Raises:
        ExpressionError: one line that names the number: a division by zero, the root of a negative number.
    """
    found = dict(drawn)
    for name, expression in derived.items():
        count = next((each.size for each in drawn.values()), 1)
        found[name] = np.array(np.broadcast_to(expression.value(found), (count,)))
    return found
