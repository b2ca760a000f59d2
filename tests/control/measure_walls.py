"""Measure presses on soft and stiff walls, with weak joints, and with a quarter and
half of what the joints can hold.

    python tests/control/measure_walls.py stiffness|weak_joints|other_arms
        [--seeds 20] [--seed 5] [--small]

Tables of docs/data/results_contact.md. Noise is that of ``measure_pressing.py``.
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from measure_pressing_scenes import VEHICLES, scene_document
from measure_tasks import together

import skyarm
from skyarm.scenario.scenario_file import scenario_from
from skyarm.studies.assess.joints import effort_limits
from skyarm.studies.assess.push_limits import pushing_efforts
from support import worlds
from support.measured_tables import mean_and_largest, print_part

PUSHES = {"arm2": 1.0, "arm6": 5.0}
"""N."""

POSES = {
    "hummingbird_arm2_rotors": (-0.45, -0.9),
    "hexarotor_arm6": (0.0, -0.6, -0.97, 0.0, -0.8, 0.0),
    "pelican_arm2": (-0.45, -0.9),
    "voliro_like": (-0.1, -1.4),
    "octo_coaxial_two_arms": (0.5, -0.8, 0.03, 0.0, 0.03),
    "quadrotor_roll_arm2": (0.0, -0.6),
    "hexarotor12_arm5": (0.0, -0.6, -0.97, -0.8, 0.0),
}
"""Shipped vehicle -> joints, rad or m, in which it presses."""

OPTIONS = {
    "hexarotor_arm6": {key: VEHICLES["arm6"][-1][key] for key in ("reach", "damping")}
}
"""Options of the law besides the thresholds."""


METRICS = ("contact_error_mean", "contact_ripple")
SIZES = ("completed", "mean error, N", "largest error", "ripple, N", "largest ripple")


def pressed(name):
    """Document of a press of the usual force."""
    document = scene_document(name)
    document["reference"]["push"]["force"]["value"] = PUSHES[name]
    return document


def cells(scenario, seeds, seed):
    """Completed flights, then mean and largest of error and ripple."""
    completed, found = together(scenario, {}, METRICS, seeds, seed)
    return [
        completed,
        *mean_and_largest(found[METRICS[0]], 3),
        *mean_and_largest(found[METRICS[1]], 3),
    ]


def grouped(number):
    """Digits of a large number by threes."""
    return f"{number:,.0f}".replace(",", " ") if number >= 1e4 else f"{number:.0f}"


def stiffness(seeds, seed):
    """Walls of 500 to 100 000 N/m."""
    for name, force in PUSHES.items():
        for k in (500.0, 5000.0, 20000.0, 100000.0):
            document = pressed(name)
            document["world"]["surfaces"][0]["material"]["stiffness"] = k
            yield (
                grouped(k),
                f"{name} {force:g} N",
                *cells(scenario_from(document), seeds, seed),
            )


def weak_joints(seeds, seed):
    """Joints that give a tenth less than commanded, without and with ``tolerances``."""
    for name, force in PUSHES.items():
        for tolerances in ([0.0, 0.0], [0.1, 0.0]):
            document = pressed(name)
            joints = scenario_from(document).plant.vehicle.links
            faults = [
                {"joint": link.joint.name, "effectiveness": 0.9} for link in joints
            ]
            document["environment"] = {"faults": faults}
            document["controller"]["tolerances"] = tolerances
            shown = f"`{tolerances}`" if any(tolerances) else "none"
            yield (
                f"{name} {force:g} N",
                shown,
                *cells(scenario_from(document), seeds, seed)[:4],
            )


def largest_force(scenario, joints):
    """Force (N) against a wall ahead at which the first joint is at its limit; the base
    is level.
    """
    limits = effort_limits(scenario.plant.vehicle)
    still, pushed = (
        pushing_efforts(scenario, joints, np.array([-force, 0.0, 0.0]))
        for force in (0.0, 1.0)
    )
    slope = pushed - still
    with np.errstate(divide="ignore"):
        return float(
            np.min(np.maximum((limits - still) / slope, (-limits - still) / slope))
        )


def other_arms(seeds, seed):
    """A quarter and half of the force that the joints can hold."""
    for name, joints in POSES.items():
        most = largest_force(worlds.before_a_wall(name, joints, 1.0), joints)
        title = f"`{name}`, servos" if skyarm.load_vehicle(name).drives else f"`{name}`"
        for part in (0.25, 0.5):
            force = part * most
            least = min(force, 1.0)
            law = {"interaction": [0.3 * least, 0.1 * least]} | OPTIONS.get(name, {})
            scenario = worlds.before_a_wall(name, joints, force, 10.0, **law)
            angles = ", ".join(f"{angle:g}" for angle in joints)
            yield (
                title,
                angles,
                f"{most:.3g}",
                f"{part:g}",
                *cells(scenario, seeds, seed),
            )


TABLES = {
    "stiffness": (("wall, N/m", "case", *SIZES), stiffness),
    "weak_joints": (("case", "`tolerances`", *SIZES[:4]), weak_joints),
    "other_arms": (
        ("vehicle", "joints, rad or m", "limit, N", "part", *SIZES),
        other_arms,
    ),
}

if __name__ == "__main__":
    print_part(__doc__, TABLES, seeds=20, seed=5)
