"""The flagship law: centre-of-mass tracking, consistent computed torque, disturbance observer, exact tip."""

from skyarm.control.exact.law import exact
from skyarm.control.exact.maker import make_exact
from skyarm.control.exact.parameters import ExactParameters
from skyarm.control.exact.presets import PRESETS

__all__ = ["PRESETS", "ExactParameters", "exact", "make_exact"]
