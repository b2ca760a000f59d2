"""Centroidal law: centre-of-mass tracking, consistent computed torque, disturbance
observer, joint or tip control.
"""

from skyarm.control.laws.centroidal.law import centroidal
from skyarm.control.laws.centroidal.make import make_centroidal
from skyarm.control.laws.centroidal.parameters import CentroidalParameters

__all__ = ["CentroidalParameters", "centroidal", "make_centroidal"]
