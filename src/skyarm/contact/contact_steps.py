"""The longest integration steps that a contact bears, and what in it asks for them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from skyarm.scalars import minimum

if TYPE_CHECKING:
    from skyarm.contact.contact import Contact

VERLET_SHARE = 0.75
"""Of a semi-implicit Euler step in one of the Stoermer-Verlet method. An elastic bounce of a limp vehicle on its tip
then errs by 0.006 % of its energy at any phase of the steps, and by 0.014 % at a share of 1 (measured); sticking holds
up to 13 N on a tip of 20 g at a friction of 0.6, as stability of the bristle has it, where a share of 1 leaves 7 N."""


def asked_steps(contact: Contact) -> tuple[tuple[str, Any], ...]:
    """What asks for an integration step, in words, and the longest that it bears, s."""
    touched = contact.surfaces if contact.points or not contact.carriers else ()
    own = [(f"the material of surface {each.name!r}", each.material.largest_step) for each in touched]
    inner = [(f"mechanism {c.name!r}", c.largest_step) for c in contact.carriers if c.largest_step is not None]
    return (*own, *contact.carried.steps(), *contact.grasps.steps(), *inner)


def euler_step(contact: Contact) -> Any:
    """Longest step (s) of the semi-implicit Euler method; None of an empty world."""
    grasped = [step for _, step in contact.grasps.steps(euler=True)]
    inner = [each.largest_euler_step for each in contact.carriers if each.largest_euler_step is not None]
    return least((*(step for _, step in contact.steps), *grasped, *inner))


def verlet_step(contact: Contact) -> Any:
    """Longest step (s) of the Stoermer-Verlet method; None of an empty world."""
    step = contact.largest_euler_step
    return None if step is None else VERLET_SHARE * step


def least(steps: Iterable[Any]) -> Any:
    """The smallest of some steps (s); None of none."""
    smallest = None
    for each in steps:
        smallest = each if smallest is None else minimum(smallest, each)
    return smallest
