"""Registry of extensions: names of all components that can be added, and the location of each."""

from skyarm.records.registry.plugins import load_plugin
from skyarm.records.registry.registrations import (
    KINDS,
    Registration,
    RegistryError,
    find,
    names,
    register,
    registrations,
)

__all__ = ["KINDS", "Registration", "RegistryError", "find", "load_plugin", "names", "register", "registrations"]
