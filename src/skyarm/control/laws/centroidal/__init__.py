"""Centroidal law: centre-of-mass tracking, consistent computed torque, disturbance observer, joint or tip control."""

from skyarm.control.laws.centroidal.law import centroidal
from skyarm.control.laws.centroidal.make import make_centroidal
from skyarm.control.laws.centroidal.parameters import CentroidalParameters
from skyarm.control.laws.centroidal.presets import PRESETS

__all__ = ["PRESETS", "CentroidalParameters", "centroidal", "make_centroidal"]
