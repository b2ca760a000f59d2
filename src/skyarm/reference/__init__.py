"""Reference motion: time signals with four derivatives, and trajectories of base,
joints and tip.
"""

from skyarm.reference.reference_tables import trajectory_from
from skyarm.reference.signals import (
    Constant,
    Product,
    Pulses,
    Ramp,
    Shifted,
    Signal,
    Sine,
    Sum,
    Windowed,
    sequence,
    signal_from,
)
from skyarm.reference.trajectory import Publisher, Reference, Trajectory, circle, hover

__all__ = [
    "Constant",
    "Product",
    "Publisher",
    "Pulses",
    "Ramp",
    "Reference",
    "Shifted",
    "Signal",
    "Sine",
    "Sum",
    "Trajectory",
    "Windowed",
    "circle",
    "hover",
    "sequence",
    "signal_from",
    "trajectory_from",
]
