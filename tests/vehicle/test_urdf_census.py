"""Every URDF file of the robot packages that are installed: it loads and equals
Pinocchio's parse, or is refused for a reason that it states.

Looked at are example-robot-data, pybullet's data and drake's examples, wherever they
are importable, and folders named by ``SKYARM_ROBOTS`` (several are parted as in PATH).
``python tests/vehicle/test_urdf_census.py FOLDER...`` prints the counts by reason.
"""

from __future__ import annotations

import math
import os
import re
import sys
from collections import Counter
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from skyarm.dynamics import array_front as arrays
from skyarm.vehicle import Vehicle, VehicleError
from skyarm.vehicle.vehicle_files import carried_robots, load_vehicle

REASONS = {
    "equal to Pinocchio's parse": "",
    "root weighs nothing: it cannot float": (
        r"base\.mass = 0\.0: must be greater than 0; its root .*\[\[attach\]\]$"
    ),
    "an axis without inertia": r"must leave no axis without inertia",
    "a joint moves no mass": r"must move mass outward of it",
    "inertia far beyond the triangle": (
        r"must obey the triangle inequality|principal moments .*: must not be negative"
    ),
    "no link at all": r"must have at least one link",
    "a kind of joint that URDF has not": (
        r"type = .*: must be one of revolute, continuous, prismatic, fixed"
    ),
    "malformed: no XML, no number, two of one element": (
        r"must be well-formed|must be a finite number|must be a number|must be three"
        r" numbers|must be at most one"
    ),
}
"""What became of a file -> what its refusal says."""

TOLERANCE = 1e-9
"""Relative to the largest entry: chains of 60 joints lose some digits in both."""


def folders() -> list[Path]:
    """Folders of robots that are there."""
    found = [
        Path(each)
        for each in os.environ.get("SKYARM_ROBOTS", "").split(os.pathsep)
        if each
    ]
    found += (
        [next(iter(carried_robots().values())).parents[2]] if carried_robots() else []
    )
    for package, below in (("pybullet_data", "."), ("pydrake", "share/drake/examples")):
        spec = find_spec(package)
        if spec is not None and spec.submodule_search_locations:
            found.append(Path(next(iter(spec.submodule_search_locations))) / below)
    return [each for each in found if each.is_dir()]


def census(files: list[Path]) -> tuple[Counter[str], list[str]]:
    """How many files came to what, and lines on those for which no reason of
    ``REASONS`` stands.
    """
    counts: Counter[str] = Counter()
    strange: list[str] = []
    for file in files:
        reason = outcome(file)
        if reason not in REASONS:
            strange.append(f"{file}: {reason}")
        counts[reason if reason in REASONS else "strange"] += 1
    return counts, strange


def outcome(file: Path) -> str:
    """One of ``REASONS``, or what happened instead."""
    try:
        vehicle = load_vehicle(file)
    except VehicleError as error:
        said = str(error).removeprefix(f"{file}: ")
        if "\n" in said or not str(error).startswith(str(file)):
            return f"refused in another form: {said}"
        return next(
            (name for name, says in REASONS.items() if says and re.search(says, said)),
            f"refused: {said}",
        )
    if any("repaired" in note for note in vehicle.notes):
        return "equal to Pinocchio's parse"
    return difference(vehicle, file.read_bytes().lstrip())


def difference(vehicle: Vehicle, text: bytes) -> str:
    """ "equal to Pinocchio's parse", or what is not."""
    import pinocchio as pin

    try:
        model = pin.buildModelFromXML(text.decode(), pin.JointModelFreeFlyer())
    except ValueError as error:
        # what we know and Pinocchio does not: a parent 'world' that no link is
        return (
            "equal to Pinocchio's parse"
            if "world" in str(error)
            else f"Pinocchio: {error}"
        )
    data, n, rng = model.createData(), vehicle.n, np.random.default_rng(1)
    joints, v = (
        rng.uniform(-1.0, 1.0, n),
        np.concatenate([np.zeros(6), rng.normal(size=n)]),
    )
    place = {link.joint.name: (joints[i], i) for i, link in enumerate(vehicle.links)}
    held = resting_values(text)
    q, G = pin.neutral(model), np.zeros((model.nv, 6 + n))
    G[:6, :6] = np.eye(6)
    for each in list(model.joints)[2:]:
        name = model.names[each.id]
        value, index = place.get(name, (held.get(name, math.nan), -1))
        q[each.idx_q : each.idx_q + each.nq] = (
            [value] if each.nq == 1 else [math.cos(value), math.sin(value)]
        )
        if index >= 0:
            G[each.idx_v, 6 + index] = 1.0
    M = pin.crba(model, data, q)
    M = G.T @ (np.triu(M) + np.triu(M, 1).T) @ G
    bias = G.T @ pin.rnea(model, data, q, G @ v, np.zeros(model.nv))
    still = (np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), joints)
    ours = arrays.mass_matrix(vehicle, *still)
    force = arrays.inverse_dynamics(vehicle, *still, v, np.zeros(6 + n), gravity=9.81)
    off = max(
        np.abs(ours - M).max() / np.abs(M).max(),
        np.abs(force - bias).max() / np.abs(bias).max(),
    )
    return "equal to Pinocchio's parse" if off <= TOLERANCE else f"off by {off:.2g}"


def resting_values(text: bytes) -> dict[str, float]:
    """Where joints that cannot move, or follow others, stand: read once more, straight
    from the elements.
    """
    import xml.etree.ElementTree as ET

    rows = {}
    for joint in ET.fromstring(text).findall("joint"):
        limit, mimic = joint.find("limit"), joint.find("mimic")
        low, high = (-math.inf, math.inf)
        if limit is not None and joint.get("type") != "continuous":
            low, high = (float(limit.get(side, "nan")) for side in ("lower", "upper"))
        rows[joint.get("name", "")] = (low, high, mimic)

    def value(name: str) -> float:
        low, high, mimic = rows.get(name, (-math.inf, math.inf, None))
        if low == high:
            return low
        if mimic is None:
            return max(0.0, low) if low > 0.0 else min(0.0, high) if high < 0.0 else 0.0
        return float(mimic.get("multiplier", 1.0)) * value(
            mimic.get("joint", "")
        ) + float(mimic.get("offset", 0.0))

    return {name: value(name) for name in rows}


@pytest.mark.thorough
def test_every_robot_loads_as_pinocchio_reads_it_or_is_refused_for_a_stated_reason():
    pytest.importorskip("pinocchio")
    if not folders():
        pytest.skip(
            "no package with robots is installed: example-robot-data, pybullet or drake"
        )
    files = sorted({file for folder in folders() for file in folder.rglob("*.urdf")})
    counts, strange = census(files)
    assert not strange
    assert counts["equal to Pinocchio's parse"] > 0


if __name__ == "__main__":
    given = [Path(each) for each in sys.argv[1:]] or folders()
    all_counts, lines = census(
        sorted({file for folder in given for file in folder.rglob("*.urdf")})
    )
    for name, count in all_counts.most_common():
        print(f"{count:6d}  {name}")
    print("\n".join(lines))
