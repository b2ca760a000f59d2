"""A safety layer around any law: what is asked of it, what it asks of the actuators, and what flies when it fails."""

from skyarm.control.safety.guard import guarded
from skyarm.control.safety.limits import Limits, limits_for

__all__ = ["Limits", "guarded", "limits_for"]
