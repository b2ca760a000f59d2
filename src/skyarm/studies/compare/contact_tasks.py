"""Tasks of the contact benchmark: bounds of their perturbations, and their scenario for
each controller.

A law that presses flies the scenario as it is shipped. One that follows positions is
led to the same places, 1 cm behind the nominal surface, and its press waits for no
force; all else is the same.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import field
from typing import Any

from skyarm.control.controller import presses
from skyarm.records.immutable import immutable
from skyarm.records.registry.shipped import TUNED as TUNED_GAINS
from skyarm.scenario.controller_table import controller_by_name
from skyarm.scenario.scenario_file import LIBRARY, scenario_from
from skyarm.scenario.scenario_record import Delays, Scenario, with_words
from skyarm.studies.compare.entrants import TUNED
from skyarm.studies.compare.suite import force_wind, library_rows
from skyarm.studies.trial.facts import PAPER
from skyarm.studies.trial.trial import NOISE, with_entries

Range = tuple[float, float]

FRICTION: Range = (0.1, 0.8)
STIFFNESS: Range = (500.0, 1e5)
"""Range of the surface stiffness (N/m), log-uniform."""

NORMAL = 0.17453292519943295
"""Largest error (rad) of the modelled normal: 10 degrees."""

RADIUS = 0.06
"""Largest relative error of the lever from the tip to a hinge."""

MASS: Range = (0.5, 2.0)
"""Range of an object's mass over the nominal one, log-uniform."""

DRAG: Range = (0.5, 2.0)
"""Range of a mechanism's closer, damping and friction over the nominal ones, each
log-uniform."""

THRUST: Range = (0.9, 1.0)
"""Range of the rotors' thrust over the nominal one."""

WIND = 2.0
"""Largest wind force (N)."""

DELAY = 0.010
"""Largest unmodelled delay (s) of the commands."""


@immutable
class ContactTask:
    """Contact task of the benchmark: scenario, desired contact force, bounds of
    perturbations, success criteria.

    Attributes:
        name: name of the shipped scenario. title: title in a few words.
        push: desired push, N; 0 without. normal: nominal, out of the surface.
        face: distance, m, from the tip's path to the nominal surface, against the
            normal.
        friction: bounds. sideways: whether the tip slides so that friction turns the
            vehicle.
        wind: N, largest.
        grip: name of a gripper that holds what goes along an arc.
        object: name of an object of unknown mass.
        numbers: path -> expression of what is drawn
            (:mod:`skyarm.studies.compare.contact_worlds`) and of "now".
        success: criterion -> expression of metrics, SI, and of "weight", N; at least 0
            where it is met.
    """

    name: str
    title: str
    push: float = 0.0
    normal: tuple[float, float, float] = (-1.0, 0.0, 0.0)
    face: float = 0.0
    friction: Range = FRICTION
    sideways: bool = False
    wind: float = WIND
    grip: str = ""
    object: str = ""
    numbers: Mapping[str, str] = field(default_factory=dict)
    success: Mapping[str, str] = field(default_factory=dict)


TASKS: Mapping[str, ContactTask] = {
    row["name"]: ContactTask(**row) for row in library_rows("contact_tasks")
}
"""Tasks by name, in the order of the tables."""


FLAGSHIP, MOTION, LOAD = "centroidal", "centroidal_motion", "centroidal_load"

OWN = (FLAGSHIP, MOTION, LOAD)
"""Variants of the scenario's own law."""

LARGEST = 0.3
"""Largest mass (kg) that a load-estimating law estimates."""

RIVALS = ("hybrid_ct", "admittance_pd")
"""Published laws that also press; they fly with tuned gains on every vehicle."""

LAWS = (*OWN, *RIVALS, "paper_ct", "paper_pd")
"""Default laws: the scenario's own with and without parts of it, the paper's two, and
these two with published contact control."""

BEHIND = 0.01
"""Distance (m) behind the modelled surface of the path of a law that tracks
positions."""


def document_of(task: ContactTask) -> dict[str, Any]:
    """Shipped scenario of a task as plain data."""
    return tomllib.loads((LIBRARY / f"{task.name}.toml").read_text("utf-8"))


def flies_its_own(task: ContactTask, law: str) -> bool:
    """True if a variant of the centroidal law behaves differently from the full law in
    a contact task.

    Without a push the flagship has no interaction to leave out, without an object no
    load to learn.
    """
    return (
        task.push > 0.0 or bool(task.grip)
        if law == MOTION
        else bool(task.object) or law != LOAD
    )


def scenario_of(
    task: ContactTask,
    law: str,
    *,
    noisy: bool,
    plant: str = "rigid_body",
    seed: int = 0,
) -> Scenario:
    """Shipped, unperturbed scenario of a task for one controller.

    Raises:
        ControllerError: no such law, or one that does not fit the vehicle.
    """
    document = document_of(task)
    document["plant"]["kind"] = plant
    if law == MOTION:
        document["controller"].pop("interaction", None)
    if law == LOAD:
        document["controller"]["load"] = LARGEST
    planned = scenario_from(document)
    if law not in OWN:
        # the paper's gains fit the paper's vehicle alone
        name = law if document["plant"]["vehicle"] == PAPER else TUNED.get(law, law)
        name = f"{law}{TUNED_GAINS}" if law in RIVALS else name
        planned = planned.with_controller(controller_by_name(planned, name))
    if task.push and not presses(planned.agent.controller.par):
        led = scenario_from(as_positions(task, document))
        planned = led.with_controller(planned.agent.controller)
    noise = NOISE if noisy else planned.agent.noise
    delays = Delays(longest_command=DELAY)
    return with_words(
        planned,
        name=task.name,
        seed=seed,
        noise=noise,
        delays=delays,
        wind=force_wind(planned),
    )


def as_positions(task: ContactTask, document: dict[str, Any]) -> dict[str, Any]:
    """Scenario for a controller without force control: desired tip path offset by
    ``BEHIND`` into the surface.
    """
    # motions that are put in take 2 s each, chosen
    path = document["reference"]["tip"]["path"]
    way = [-(task.face + BEHIND) * n for n in task.normal]
    start = list(path["position"])
    at = list(path["position"])
    phases = list[dict[str, Any]]()
    for phase in path["phases"]:
        replacement = {**phase}
        kind = phase["kind"]
        if kind == "press":
            phases.append(
                {"kind": "go_to", "position": _shift(at, way), "duration": 2.0}
            )
            # nothing to wait for: any tip within 1 m of its path ends the press
            replacement["until"] = {
                "error": 1.0,
                "hold": 0.1,
                "timeout": 1.0,
                "on_timeout": "go_on",
            }
        elif kind == "insert":
            deeper = [-float(phase["distance"]) * n for n in task.normal]
            replacement = {
                "kind": "slide",
                "position": _shift(_shift(at, way), deeper),
                "duration": 2.0,
            }
        elif kind == "retreat":
            replacement = {"kind": "retreat", "position": start}
        elif "points" in phase:
            replacement["points"] = [_shift(point, way) for point in phase["points"]]
            at = list(phase["points"][-1])
        elif "position" in phase:
            replacement["position"] = _shift(phase["position"], way)
            at = list(phase["position"])
        phases.append(replacement)
    return with_entries(document, {"reference": {"tip": {"path": {"phases": phases}}}})


def _shift(place: list[float], way: list[float]) -> list[float]:
    return [p + w for p, w in zip(place, way, strict=True)]
