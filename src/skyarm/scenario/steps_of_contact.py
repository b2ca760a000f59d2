"""Numbers of a world with which contact would ask for integration steps too short to fly, by their names in a file."""

from __future__ import annotations

import math
from collections.abc import Iterator

from skyarm.compile import leaves
from skyarm.contact.contact import Contact
from skyarm.files import shown
from skyarm.plant.largest_step import MOST_STEPS
from skyarm.records.coerce import concrete
from skyarm.records.leaves import Place
from skyarm.records.replace_parts import part, replaced

USUAL: dict[str, dict[str, float]] = {
    "surfaces": {"material.stiffness": 5000.0, "material.friction": 0.3, "material.bristle_length": 2e-4},
    "objects": {"mass": 1.0, "material.stiffness": 5000.0, "material.friction": 0.3, "material.bristle_length": 2e-4},
    "mechanisms": {
        "mass": 1.0, "inertia": 1.0, "stiffness": 1.0, "damping": 1.0, "friction": 1.0, "bristle": 2e-3,
        "detent.force": 1.0, "detent.width": 0.01, "stop_stiffness": 5000.0, "material.stiffness": 5000.0,
        "material.friction": 0.3, "material.bristle_length": 2e-4,
    },
    "grippers": {"stiffness": 5000.0},
}  # fmt: skip
"""Numbers from which steps follow, and ones that ask for none that are short. The number to change is the one that
asks for the shortest steps in a world in which all others are these."""

HALVINGS = 50
"""Of the way between a number and its usual one, as powers: it ends far below the digits that are said."""


def require_steps_to_fly(contact: Contact, period: float) -> None:
    """Refuse a world whose contact asks for more steps of a control period (s) than ``MOST_STEPS``.

    Raises:
        ValueError: one line: the number that asks for them, and about how far it may go.
    """
    if not concrete(*leaves(contact)):
        return  # of a batch: its lanes are looked at one by one
    least = period / MOST_STEPS
    step = _step(contact)
    if step >= least:
        return
    asked = f"asks for integration steps of {step:.2g} s in contact"
    allowed = f"must leave them {least:g} s or more, a thousandth of the control period"
    numbers = dict(_numbers(contact))
    plain = replaced(contact, dict(numbers))
    if _step(plain) < least:
        raise ValueError(f"world: what is light, large or stiff in it {asked}, {allowed}")
    place = min(numbers, key=lambda each: _step(replaced(plain, {each: part(contact, each)})))
    usual = numbers[place]
    value = float(part(contact, place))
    raise ValueError(
        f"{_path(place)} = {shown(value)}: {asked}, {allowed}{_bound(contact, place, value, usual, least)}"
    )


def _step(contact: Contact) -> float:
    """Longest integration step (s) that a contact bears; 0 where its numbers leave none."""
    try:
        step = contact.largest_step
    except ArithmeticError:  # of numbers beyond measure
        return 0.0
    return math.inf if step is None else float(step) if step > 0.0 else 0.0


def _numbers(contact: Contact) -> Iterator[tuple[Place, float]]:
    """Place and usual number of each of the world's numbers from which steps follow."""
    for what, fields in USUAL.items():
        for i, each in enumerate(getattr(contact, what)):
            for field, usual in fields.items():
                place = (what, str(i), *field.split("."))
                if place[2] == "detent" and each.detent is None:
                    continue
                if float(part(contact, place)) != 0.0:  # 0 leaves it out, or to other numbers
                    yield place, usual


def _bound(contact: Contact, place: Place, value: float, usual: float, least: float) -> str:
    """About how far the number may go, in words; nothing where the rest of the world asks for too short steps, too."""
    if _step(replaced(contact, {place: usual})) < least:
        return ""
    short, long = math.log(value), math.log(usual)
    for _ in range(HALVINGS):
        middle = 0.5 * (short + long)
        if _step(replaced(contact, {place: math.exp(middle)})) < least:
            short = middle
        else:
            long = middle
    return f": about {math.exp(long):.2g} or {'less' if value > usual else 'more'}"


def _path(place: Place) -> str:
    """As a file has it."""
    what, i, *fields = place
    return f"world.{what}[{i}].{'.'.join(fields)}"
