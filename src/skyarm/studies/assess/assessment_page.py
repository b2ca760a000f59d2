"""The page of an assessment: findings, what to change, and pictures of the vehicle in its worst poses."""

from __future__ import annotations

import math
from html import escape
from pathlib import Path

import numpy as np

from skyarm.dynamics.actuators import make_mixer
from skyarm.records.files import write_atomically
from skyarm.studies.assess.arm_poses import Allocation
from skyarm.studies.assess.assessment import Assessment
from skyarm.studies.assess.finding import FAULT, NOTE, OK, WARNING, Finding
from skyarm.studies.assess.thrust import roll_pitch_boundary
from skyarm.view.figures.study_figures import attainable_torque_figure
from skyarm.view.figures.style import image_bytes
from skyarm.view.figures.vehicle_drawing import vehicle_drawing
from skyarm.view.pages import details, image, page, section, table

MARKS = {OK: "&#10003;", NOTE: "&#183;", WARNING: "!", FAULT: "&#10007;"}
"""What stands before a finding beside its level in words."""

DRAWN = 3
"""Worst poses that are drawn."""

SHOWN = ("thrust margin", "largest payload", "centre of mass", "pitch authority", "roll authority")
"""Questions whose worst pose is worth a picture, in this order, after those of alarms."""

DPI = 110


def write_page(found: Assessment, file: Path) -> Path:
    """Write the page of an assessment, whole or not at all."""
    return write_atomically(file, assessment_page(found).encode())


def assessment_page(found: Assessment) -> str:
    """HTML of an assessment: one file that needs nothing else."""
    faults, warnings = (sum(each.level == level for each in found.findings) for level in (FAULT, WARNING))
    verdict = "cannot fly as described" if faults else "can fly"
    facts = f"{verdict}; faults: {faults}, warnings: {warnings}; g = {found.gravity:g} m/s^2; {found.poses} arm poses"
    if found.payload:
        facts += f"; {found.payload:g} kg at the tip"
    name = found.name if found.name == found.vehicle.name else f"{found.name} ({found.vehicle.name})"
    alarms = found.alarms()
    remedies = dict.fromkeys(_remedy(each) for each in alarms)
    body = [section("What to change", "".join(remedies))] if alarms else []
    told = [*alarms, *(each for each in found.findings if each.level == NOTE)]
    well = [each for each in found.findings if each.level == OK]
    folded = details(f"{len(well)} questions without an alarm", "".join(map(_answer, well)))
    body.append(section("Findings", "".join(map(_answer, told)) + folded))
    head = ("question", "level", ">found", ">limit", "field")
    body.append(section("Worst poses", _pictures(found)))
    body.append(section("Numbers", table(head, map(_row, _numbers(found)))))
    return page(f"{name}: {verdict}", facts, "".join(body))


def _answer(each: Finding) -> str:
    return (
        f"<p><strong>{MARKS[each.level]} {escape(each.level)}</strong> {escape(each.question)}: {escape(each.text)}</p>"
    )


def _remedy(each: Finding) -> str:
    return f"<p><strong>{escape(each.field or each.question)}</strong>: {escape(each.remedy or each.text)}</p>"


def _numbers(found: Assessment) -> list[Finding]:
    return [each for each in found.findings if not math.isnan(each.value)]


def _row(each: Finding) -> tuple[str, ...]:
    limit = "" if math.isnan(each.limit) else f"{each.limit:.4g} {each.unit}"
    return each.question, each.level, f"{each.value:.4g} {each.unit}", limit, each.field


def _pictures(found: Assessment) -> str:
    """Drawings of the vehicle in the poses that its alarms, then the usual questions, name as their worst."""
    vehicle = found.vehicle
    poses: dict[tuple[float, ...], list[str]] = {}
    ordered = [*found.alarms(), *(f for name in SHOWN for f in found.findings if f.question == name)]
    for each in ordered:
        if len(each.joints) == vehicle.n and vehicle.n:
            rounded = tuple(round(q, 3) + 0.0 for q in each.joints)
            poses.setdefault(rounded, []).append(each.question)
    drawn = list(poses.items())[:DRAWN]
    parts = [_drawing(found, (), "as it is drawn at rest")] if not drawn else []
    for joints, questions in drawn:
        at = ", ".join(f"{link.joint.name} {q:g}" for link, q in zip(vehicle.links, joints, strict=True))
        parts.append(_drawing(found, joints, f"worst for {', '.join(dict.fromkeys(questions))}: {at}"))
    return "".join([*parts, _torques(found)])


def _drawing(found: Assessment, joints: tuple[float, ...], caption: str) -> str:
    figure = vehicle_drawing(found.vehicle, joints or None)
    return image(f"{found.vehicle.name}, {caption}", caption, image_bytes(figure, dpi=DPI), wide=True, whole=True)


def _torques(found: Assessment) -> str:
    """The attainable roll and pitch torques with the arm at zero and in the worst pose for them."""
    worst = [f for f in found.findings if f.question in ("roll authority", "pitch authority")]
    if not worst:
        return ""
    allocation = Allocation.of(make_mixer(found.vehicle))
    limit = min(worst, key=lambda each: each.value)
    poses = [("arm at zero", np.zeros(found.vehicle.n))]
    if found.vehicle.n:
        poses.append(("worst pose", np.array(limit.joints)))
    curves = [(label, roll_pitch_boundary(found.vehicle, allocation, q, found.gravity)) for label, q in poses]
    if not all(np.isfinite(corners).all() for _, corners in curves):
        return ""  # rotors without a highest speed
    caption = "Roll and pitch torques that the rotors can add to a level hover."
    return image(caption, caption, image_bytes(attainable_torque_figure(curves), dpi=DPI))
