"""Safety layer around any control law: bounded references and commands, joint barrier,
supervisor and recovery.
"""

from skyarm.control.safety.limits import Limits, limits_for
from skyarm.control.safety.safety_layer import with_safety_layer

__all__ = ["Limits", "limits_for", "with_safety_layer"]
