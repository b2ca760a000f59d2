"""Every controller by its name: laws, presets, laws with tuned gains, and other names of each.

The answers to what there is stand in :data:`LAWS` (with the options of each), :data:`PRESETS`,
:func:`tuned_factors` and :func:`choices`; :func:`named` makes a controller from any name, :func:`make_controller` from
a law and its options.
"""

from skyarm.control.catalogue.controller_names import (
    aliases,
    choices,
    full_name,
    is_named,
    make_named,
    meant,
    require_different,
)
from skyarm.control.catalogue.law_entries import LAWS, Entry, make_controller, suitable_options
from skyarm.control.catalogue.presets import ACCELERATION, HUMMINGBIRD, PRESETS, TORQUE, Preset, preset
from skyarm.control.catalogue.tuned_gains import KNOBS, make_tuned, rescale, tuned_factors
from skyarm.control.controller import Controller, ControllerError
from skyarm.files.old_names import old_attributes
from skyarm.registry.shipped import TUNED

__all__ = [
    "ACCELERATION",
    "HUMMINGBIRD",
    "KNOBS",
    "LAWS",
    "PRESETS",
    "TORQUE",
    "TUNED",
    "Controller",
    "ControllerError",
    "Entry",
    "Preset",
    "aliases",
    "choices",
    "full_name",
    "is_named",
    "make_controller",
    "make_named",
    "make_tuned",
    "meant",
    "preset",
    "require_different",
    "rescale",
    "suitable_options",
    "tuned_factors",
]

__getattr__ = old_attributes(__name__, {"named": "make_named", "tuned": "make_tuned"})
