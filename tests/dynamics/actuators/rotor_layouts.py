"""Rotor layouts written by hand, and nothing else of a vehicle."""

from __future__ import annotations

import math

from skyarm.algebra import Sym3, Vec3
from skyarm.vehicle.linkage import Body
from skyarm.vehicle.vehicle_records import Rotor, Vehicle

K_F, K_M, ARM, HIGHEST = 8.54858e-6, 0.016, 0.17, 838.0
BASE = Body(mass=0.73103, inertia=Sym3(0.0077174, 0.0077174, 0.0130804))


def hummingbird_rotor(**changes) -> Rotor:
    fields = {
        "name": "r",
        "position": Vec3(0, 0, 0),
        "direction": 1,
        "thrust_coefficient": K_F,
        "moment_coefficient": K_M,
        "drag_coefficient": 8.06428e-5,
        "rolling_moment_coefficient": 1e-6,
        "time_constant_up": 0.0125,
        "time_constant_down": 0.025,
        "max_speed": HIGHEST,
    }
    return Rotor(**(fields | changes))


def layout(
    name: str, rotors: list[tuple[float, float, float, int, float, float]]
) -> Vehicle:
    """Rotors from (x, y, z, direction, tilt of the axis about x, about y)."""
    made = tuple(
        hummingbird_rotor(
            name=f"r{i}",
            position=Vec3(x, y, z),
            direction=direction,
            axis=Vec3(
                math.sin(ty), -math.sin(tx) * math.cos(ty), math.cos(tx) * math.cos(ty)
            ),
        )
        for i, (x, y, z, direction, tx, ty) in enumerate(rotors)
    )
    return Vehicle(name=name, base=BASE, rotors=made)


def ring(
    count: int, tilt: float = 0.0, radius: float = ARM
) -> list[tuple[float, float, float, int, float, float]]:
    """Rotors in a circle, first one in front, alternately cw and ccw, tilted about
    their arms.
    """
    found = []
    for i in range(count):
        a = 2.0 * math.pi * i / count
        lean = tilt * (-1) ** i
        found.append(
            (
                radius * math.cos(a),
                radius * math.sin(a),
                0.01,
                -1 if i % 2 == 0 else 1,
                lean * math.cos(a),
                lean * math.sin(a),
            )
        )
    return found


HUMMINGBIRD = layout("hummingbird", ring(4))
# four arms with two rotors each, one above the other, turning against each other
COAXIAL = layout(
    "coaxial",
    [
        (x, y, z, s * (1 if z > 0 else -1), 0.0, 0.0)
        for (x, y, s) in (
            (0.2, 0.2, 1),
            (-0.2, 0.2, -1),
            (-0.2, -0.2, 1),
            (0.2, -0.2, -1),
        )
        for z in (0.05, -0.05)
    ],
)
# a ring of six with every rotor moved and tilted by hand: no symmetry is left
LOPSIDED = layout(
    "lopsided",
    [
        (0.22, 0.02, 0.00, -1, 0.05, 0.04),
        (0.08, 0.17, 0.02, 1, -0.08, 0.00),
        (-0.11, 0.16, 0.00, -1, 0.03, 0.06),
        (-0.19, -0.01, 0.01, 1, 0.00, -0.05),
        (-0.07, -0.18, 0.03, -1, 0.04, 0.02),
        (0.10, -0.14, 0.01, 1, -0.02, 0.07),
    ],
)
LAYOUTS = {
    "hummingbird": HUMMINGBIRD,
    "hexa": layout("hexa", ring(6)),
    "octo": layout("octo", ring(8)),
    "tilted_hexa": layout("tilted_hexa", ring(6, tilt=0.35)),
    "coaxial": COAXIAL,
    "lopsided": LOPSIDED,
}
