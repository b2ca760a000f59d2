"""Checks of a vehicle's fields: bounds, names, and physical consistency of an inertia.

Each message names the field, the value and what is allowed; the file is added by the
reader that knows it. :class:`skyarm.vehicle.Vehicle` checks itself as a whole.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from itertools import pairwise
from typing import Any, NoReturn

import numpy as np

from skyarm.algebra import Scalar, Sym3
from skyarm.records.arrays import doubles
from skyarm.records.coerce import TOLERANCE, RecordError, coefficient, concrete
from skyarm.records.field_rules import accept_fields
from skyarm.records.files import shown

FARTHEST = 10.0
"""Largest plausible distance (m) from one part to the next; an arm of 15 mm written in
millimetres is longer."""

TURN = 2.0 * math.pi * 1.001, FARTHEST
"""Largest plausible joint position: one turn (rad), with a margin for rounding in
files, or a length (m)."""

RANGE = 2.0 * TURN[0], FARTHEST
"""Largest plausible limit of a joint: two turns (rad), as robots have of up to 10 rad,
or a length (m)."""

NOISE = 1e-15
"""Size (kg m^2) of a negative moment that counts as rounding; a milligram at 30
micrometres has as much."""

SHARE: Mapping[str, Any] = {"low": 0.0, "folds": True, "rule": coefficient}
"""Declaration of a number of at least 0 whose integer zero is structure: the effect is
absent."""


class VehicleError(RecordError):
    """Error in a vehicle's description."""


def accept_named(record: Any, kind: str) -> None:
    """Check and convert the fields of a dataclass; errors name the element, as in
    ``joints[shoulder].axis``.

    Raises:
        VehicleError: one line with field, value and what is allowed.
    """
    # a follower has the name of its link, and none if that is of a wrong type, which
    # is refused below
    name = getattr(record, "name", "")
    accept_fields(
        record,
        f"{kind}s[{name}]" if isinstance(name, str) and name else kind,
        VehicleError,
    )


def refuse(field: str, value: object, allowed: str) -> NoReturn:
    """Raise an error about an invalid field, with the field's value and the allowed
    values on one line.
    """
    raise VehicleError(f"{field} = {shown(value)}: {allowed}")


def inertia(field: str, inertia_com: Sym3, *, planar: bool, least: float = 0.0) -> None:
    """Check an inertia for physical consistency: positive semi-definite, triangle
    inequality of principal moments.

    Args:
        field: name in messages.
        inertia_com: inertia about the centre of mass, kg m^2.
        planar: True for a planar model, which obeys no triangle inequality.
        least: kg m^2; all moments of a solid body are larger.
    """
    # plain numbers only: a batch or a trace is checked where its numbers become known
    if not concrete(*inertia_com.entries):
        return
    moments = principal_moments(inertia_com)
    # 1e-300 keeps the slack of a point mass above zero without widening it
    slack = TOLERANCE * max(*map(abs, moments), 1e-300)
    shown = f"principal moments {', '.join(f'{m:.6g}' for m in moments)}"
    if moments[0] < -slack:
        refuse(field, shown, "must not be negative")
    if least > 0.0 and moments[0] < least:
        refuse(
            field,
            shown,
            f"must leave no axis without inertia: at least {least:g} kg m^2 about each",
        )
    # between zero and rounding no solver can tell an axis without inertia from one with
    # it
    if 0.0 < moments[2] < NOISE:
        refuse(field, shown, f"must be 0 or at least {NOISE:g} kg m^2")
    if not planar and moments[0] + moments[1] < moments[2] - slack:
        nearest = ", ".join(
            f"{float(each):.6g}" for each in nearest_inertia(inertia_com).entries
        )
        refuse(
            field,
            shown,
            "must obey the triangle inequality; the nearest of a real body is"
            f" {nearest} kg m^2 (xx yy zz xy xz yz about the centre of mass): state it,"
            ' or inertia_repair = "nearest" in a vehicle file that names this one;'
            " planar = true is for laws' models only",
        )


def nearest_inertia(inertia: Sym3) -> Sym3:
    """Nearest physically consistent inertia (kg m^2) about the same centre of mass in
    the same axes.
    """
    given = doubles(inertia.full().rows)
    # J = tr(S) I - S: an inertia is physical if and only if its second moments S have
    # no negative eigenvalue
    values, axes = np.linalg.eigh(0.5 * np.trace(given) * np.eye(3) - given)
    # clipping the eigenvalues gives the nearest positive semi-definite matrix in the
    # Frobenius norm
    second = (axes * np.maximum(values, 0.0)) @ axes.T
    found = np.trace(second) * np.eye(3) - second
    # products that were zero stay structure
    size = 1e-15 * float(np.abs(given).max())
    entries = [
        float(found[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    ]
    return Sym3.from_numbers(*(0.0 if abs(each) <= size else each for each in entries))


def rising(field: str, column: Sequence[Scalar], why: str = "") -> None:
    """Raise an error unless a sequence of numbers, such as a table column, is strictly
    increasing.
    """
    for i, (a, b) in enumerate(pairwise(column)):
        if concrete(a, b) and not a < b:
            refuse(
                f"{field}[{i + 1}]", b, f"must be above the one before it, {a:g}{why}"
            )


def principal_moments(inertia_com: Sym3) -> list[float]:
    """Principal moments of inertia (kg m^2) in ascending order."""
    # of lists, which NumPy reads in a third of the time of vectors
    moments: list[float] = np.linalg.eigvalsh(
        [[*row] for row in inertia_com.full().rows]
    ).tolist()
    return moments


def unused_name(name: str, taken: Collection[str]) -> str:
    """Unique name: the given one, with underscores appended if it is taken."""
    while name in taken:
        name += "_"
    return name


def unique(field: str, names: list[str]) -> None:
    """Raise an error if names are repeated or empty."""
    for name in names:
        if not name:
            refuse(field, name, "must have a name")
        if names.count(name) > 1:
            refuse(field, name, "stands twice; names must be unique")
