"""The flagship law: centre-of-mass tracking, consistent computed torque, disturbance observer, exact tip."""

from skyarm.control.exact.law import exact
from skyarm.control.exact.maker import MAKERS, PRESETS, make_exact
from skyarm.control.exact.parameters import ExactParameters

__all__ = ["MAKERS", "PRESETS", "ExactParameters", "exact", "make_exact"]
