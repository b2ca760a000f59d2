"""Registry of extensions: names and locations of laws, sensors, forces and other
objects that users can add.
"""

from skyarm.records.registry.plugins import load_plugin
from skyarm.records.registry.registrations import (
    Registration,
    RegistryError,
    find,
    names,
    register,
    registrations,
)
from skyarm.records.registry.shipped import KINDS

__all__ = [
    "KINDS",
    "Registration",
    "RegistryError",
    "find",
    "load_plugin",
    "names",
    "register",
    "registrations",
]
