"""The normal of a surface, found by sliding on it.

A tip that slides moves along the surface, so what its velocity has along the believed normal n is an error of n, seen
in the direction of the motion alone:

    lean' = -rate (n . v) v / (|v|^2 + slow^2),   n = (told + lean) / |told + lean|

It learns while the tip presses with its full force and its reference leads it along the surface. Friction is no help:
which way it pushes nobody knows at rest. A surface that itself moves along n would be taken for a slope.
"""

from __future__ import annotations

from typing import Any

from skyarm.algebra import Vec3
from skyarm.scalars import clip, divide, sqrt, where

SLOW = 0.02
"""m/s: speeds below which a direction of sliding is little known."""

STEEPEST = 0.4
"""Of each component of the lean: 20 degrees and more of a surface that was told as level."""


def leaning(told: Vec3, lean: Vec3) -> Vec3:
    """The unit normal that is believed."""
    n = told + lean
    # a reference that has not begun has no normal
    unit: Vec3 = n * divide(1.0, sqrt(n.dot(n) + 1e-12))
    return unit


def slid(lean: Vec3, n: Vec3, velocity: Vec3, rate: Any, asked: Any, slides: Any, dt: Any) -> Vec3:
    """The lean one period later; none where no contact is asked for.

    Args:
        lean: before.
        n: believed.
        velocity: of the tip, m/s, world axes.
        rate: 1/s.
        asked: whether contact is asked for.
        slides: whether the tip presses and is led along the surface.
        dt: s.
    """
    share = where(slides, rate * dt, 0.0) * divide(n.dot(velocity), velocity.dot(velocity) + SLOW * SLOW)
    moved = lean - velocity * share
    return Vec3(*(where(asked, clip(each, -STEEPEST, STEEPEST), 0.0) for each in moved))
