"""Which of the numbers that a contact logs belongs to which array of a log."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from skyarm.log.log_columns import CONTACT_ARRAYS, GRIPPER_ARRAYS, MECHANISM_ARRAYS, OBJECT_ARRAYS
from skyarm.scenario.scenario_record import Scenario


def logged_in_contact(scenario: Scenario, numbers: Sequence[Any]) -> dict[str, list[Any]]:
    """Array of a log -> its columns, of numbers as :meth:`skyarm.contact.contact.Contact.logged` gives them."""
    found: dict[str, list[Any]] = {}
    for contact in scenario.contacts:
        pairs, wide = contact.logged_pairs, len(CONTACT_ARRAYS)
        touching, behind = numbers[: wide * pairs], list(numbers[wide * pairs :])
        if pairs:
            found |= {name: list(touching[i::wide]) for i, name in enumerate(CONTACT_ARRAYS)}
        for _ in contact.objects:
            for name, width in OBJECT_ARRAYS.items():
                found.setdefault(name, []).extend(behind[:width])
                behind = behind[width:]
        for _ in contact.mechanisms:
            for name, number in zip(MECHANISM_ARRAYS, behind, strict=False):
                found.setdefault(name, []).append(number)
            behind = behind[len(MECHANISM_ARRAYS) :]
        for _ in contact.grippers:
            for name, width in GRIPPER_ARRAYS.items():
                found.setdefault(name, []).extend(behind[:width])
                behind = behind[width:]
    return found
