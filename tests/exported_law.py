"""An exported controller, compiled and loaded: its C structs read back from the text, its step called from Python."""

from __future__ import annotations

import ctypes
import dataclasses
import re

from c_compiler import library


def structs(text: str, name: str = "law"):
    """The C structs as the file itself declares them, read back by their text."""
    found = {}
    for key, body in re.findall(rf"^struct {name}_(\w+) {{\n(.*?)^}};", text, re.MULTILINE | re.DOTALL):
        members = []
        for kind, member, sizes in re.findall(r"^    (double|float) (\w+)((?:\[\d+\])*);", body, re.MULTILINE):
            held = {"double": ctypes.c_double, "float": ctypes.c_float}[kind]
            for size in reversed(re.findall(r"\d+", sizes)):
                held = held * int(size)
            members.append((member, held))
        found[key] = type(key, (ctypes.Structure,), {"_fields_": members})
    return found


def fill(struct, record) -> None:
    """A record's fields into the members of the same name."""
    for field in dataclasses.fields(record):
        value = getattr(record, field.name)
        if not hasattr(value, "__iter__"):
            setattr(struct, field.name, value)
        elif held := list(value):
            getattr(struct, field.name)[:] = held  # refuses another length


class Loaded:
    """An exported controller, loaded."""

    def __init__(self, text: str, folder, flags=("-O2",), name: str = "law") -> None:
        self.kinds, self.name = structs(text, name), name
        self.library = library(text, folder, flags, name)
        self.parameters = self.kinds["parameters"].in_dll(self.library, f"{name}_default_parameters")
        self.memory = self.kinds["memory"]()
        ctypes.pointer(self.memory)[0] = self.kinds["memory"].in_dll(self.library, f"{name}_first_memory")

    def __call__(self, measurement, reference, parameters=None) -> list[float]:
        m, r, command = self.kinds["measurement"](), self.kinds["reference"](), self.kinds["command"]()
        fill(m, measurement)
        fill(r, reference)
        arguments = [ctypes.byref(each) for each in (m, r, self.memory, command)]
        if parameters is None:
            getattr(self.library, f"{self.name}_step")(*arguments)
        else:
            getattr(self.library, f"{self.name}_step_with")(ctypes.byref(parameters), *arguments)
        return [*command.rotor_speeds, *getattr(command, "efforts", ()), *getattr(command, "tilts", ())]

    def copy_of_parameters(self):
        copy = self.kinds["parameters"]()
        ctypes.pointer(copy)[0] = self.parameters
        return copy
