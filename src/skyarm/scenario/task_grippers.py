"""Commands of grippers that phases of a reference close and open."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

from skyarm.contact.contact import Contact
from skyarm.contact.gripper import Command, Gripper
from skyarm.files import did_you_mean, shown
from skyarm.reference.signals import Constant, Sum, Windowed
from skyarm.reference.task_records import TaskEvent


def with_commands(contact: Contact | None, events: Sequence[TaskEvent], control_rate: float) -> Contact | None:
    """The contact whose grippers close and open where phases say it.

    Args:
        contact: as read; None without a world.
        events: of the phases that name a gripper.
        control_rate: Hz; instants are whole control periods.

    Raises:
        ValueError: one line: a gripper that is not there, or one that has its command from elsewhere.
    """
    grippers = {each.name: each for each in (contact.grippers if contact else ())}
    for event in events:
        at = f"{event.where}.gripper = {shown(event.gripper)}"
        if event.gripper not in grippers:
            near, there = did_you_mean(event.gripper, grippers), ", ".join(grippers) or "none"
            raise ValueError(f"{at}: {near}must be the name of one of [[world.grippers]]; there are {there}")
        if grippers[event.gripper].kind == "hook" or grippers[event.gripper].closed != Command():
            raise ValueError(f"{at}: must be a gripper without a command of its own (closed)")
    if contact is None or not events:
        return contact
    found = tuple(_commanded(each, events, control_rate) for each in contact.grippers)
    return dataclasses.replace(contact, grippers=found)


def _commanded(gripper: Gripper, events: Sequence[TaskEvent], rate: float) -> Gripper:
    """A gripper that is closed from each instant at which a phase takes something to the next at which one leaves."""
    own = [each for each in events if each.gripper == gripper.name]
    if not own:
        return gripper
    windows, since = [], None
    for event in own:
        instant = math.ceil(event.time * rate - 1e-9) / rate
        if (event.kind == "pick") is (since is not None):
            done = "holds something already" if event.kind == "pick" else "holds nothing"
            raise ValueError(f"{event.where}.gripper = {shown(event.gripper)}: must be another one: it {done} there")
        if since is None:
            since = instant
        else:
            windows.append(Windowed(Constant(1), since, instant))
            since = None
    if since is not None:
        windows.append(Windowed(Constant(1), since))
    signal = windows[0] if len(windows) == 1 else Sum(tuple(windows))
    return dataclasses.replace(gripper, closed=Command(signal))
