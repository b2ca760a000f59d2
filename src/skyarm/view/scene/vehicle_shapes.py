"""The shapes of a vehicle: its hull, a boom and a disc for each rotor, rods to all that a body carries, its tip."""

from __future__ import annotations

import math

from skyarm.algebra import ZERO3, Vec3
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_records import Look, Vehicle
from skyarm.view.scene.meshes import own_mesh
from skyarm.view.scene.shapes import Shape, Vector, between, floats, turn_onto

LEAST_REACH = 0.1
"""m: scale of what has no rotors."""

PAYLOAD_DENSITY = 2000.0
"""kg/m^3: a payload is drawn as a ball of this density, between water's and aluminium's."""

_ORIGIN: Vector = (0.0, 0.0, 0.0)


def vehicle_shapes(vehicle: Vehicle, *, meshes: bool = True) -> tuple[Shape, ...]:
    """Shapes to draw a vehicle by: meshes of its links, else guesses from its rotors and joints.

    Args:
        vehicle: with concrete numbers.
        meshes: whether links are drawn as the meshes that their file names, where these are there.
    """
    reach = longest_boom(vehicle)
    drawn = [(look, _mesh_shape(i, look)) for i, look in enumerate(vehicle.looks) if meshes]
    drawn = [(look, shape) for look, shape in drawn if own_mesh(shape)]
    # what a fixed joint merged into a body, as the mount of an arm, is a frame of it: it covers a part alone
    merged = {frame.name for frame in vehicle.frames}
    covered = {look.link for look, _ in drawn if look.name not in merged}
    hull = Shape("hull", "hull", "ellipsoid", BASE, (0.35 * reach, 0.35 * reach, 0.15 * reach))
    shapes = [] if BASE in covered else [hull]
    shapes += _rotor_shapes(vehicle, reach)
    shapes += _rods(vehicle, BASE, "base", 0.04 * reach)
    shapes += [shape for _, shape in drawn]
    for i, link in enumerate(vehicle.moving):
        if i not in covered:
            shapes += _rods(vehicle, i, f"link/{link.name}", 0.04 * reach)
        if link.joint.kind == "revolute":
            half = 0.07 * reach
            axis = floats(link.joint.axis)
            ends = (floats(-half * c for c in axis), floats(half * c for c in axis))
            shapes.append(between(f"joint/{link.joint.name}", "joint", "cylinder", i, 0.055 * reach, *ends))
    if vehicle.end_effector:
        tip = vehicle.frame()
        shapes.append(Shape("tip", "tip", "sphere", tip.link, (0.05 * reach,), floats(tip.position)))
    return tuple(shapes)


def payload_shape(vehicle: Vehicle, mass: float, frame: str = "", com: Vec3 = ZERO3) -> Shape:
    """Ball of a payload (kg) about its centre of mass (m, axes of the frame), at a frame or the end effector."""
    at = vehicle.frame(frame or None)
    radius = (3.0 * max(mass, 0.0) / (4.0 * math.pi * PAYLOAD_DENSITY)) ** (1.0 / 3.0)
    return Shape("payload", "payload", "sphere", at.link, (radius,), floats(at.position + at.rotation.apply(com)))


def rotor_radius(vehicle: Vehicle) -> float:
    """Radius of the discs, m: neighbours leave each other a tenth of their distance, or half the longest boom."""
    hubs = [floats(rotor.position) for rotor in vehicle.rotors]
    apart = [math.dist(a, b) for i, a in enumerate(hubs) for b in hubs[:i] if math.dist(a, b) > 1e-6]
    longest = 0.5 * longest_boom(vehicle)
    # coaxial pairs are closer than their discs are wide
    sideways = [d for d in apart if d > 0.3 * longest]
    return min([longest, *(0.45 * d for d in sideways)])


def longest_boom(vehicle: Vehicle) -> float:
    """Distance of the farthest rotor from the base, m; LEAST_REACH without rotors: the scale of every shape."""
    return max((math.hypot(*floats(rotor.position)) for rotor in vehicle.rotors), default=0.0) or LEAST_REACH


def _rotor_shapes(vehicle: Vehicle, reach: float) -> list[Shape]:
    shapes = []
    radius = rotor_radius(vehicle)
    for rotor in vehicle.rotors:
        hub = floats(rotor.position)
        if math.hypot(*hub) > 1e-6:
            shapes.append(between(f"boom/{rotor.name}", "boom", "capsule", BASE, 0.03 * reach, _ORIGIN, hub))
        disc, axis = (radius, 0.02 * reach), turn_onto(floats(rotor.axis))
        shapes.append(Shape(f"rotor/{rotor.name}", "rotor", "cylinder", BASE, disc, hub, axis))
    return shapes


def _rods(vehicle: Vehicle, body: int, name: str, radius: float) -> list[Shape]:
    """A rod from a body's origin to each joint and frame that it carries; a last link's is to its centre of mass."""
    ends = [(other.joint.name, other.joint.position) for other in vehicle.moving if other.parent == body]
    ends += [(frame.name, frame.position) for frame in vehicle.frames if frame.link == body]
    role = "boom" if body == BASE else "link"
    if body != BASE and not ends:
        ends = [("com", vehicle.moving[body].body.com)]
    rods = []
    for carried, end in ends:
        if math.hypot(*floats(end)) > 1e-6:
            rods.append(between(f"{name}/{carried}", role, "capsule", body, radius, _ORIGIN, floats(end)))
    return rods


def _mesh_shape(number: int, look: Look) -> Shape:
    """A link's mesh as its file has it."""
    a, b, c = (floats(row) for row in look.rotation.rows)
    role = "hull" if look.link == BASE else "link"
    name = f"mesh{number + 1}/{look.name}"
    return Shape(name, role, "mesh", look.link, floats(look.scale), floats(look.position), (a, b, c), look.file)
