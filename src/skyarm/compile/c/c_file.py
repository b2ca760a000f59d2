"""A C99 file with one function on structs: ``void NAME_step(inputs, memory, command)``.

The same file is its own header: with ``NAME_INTERFACE_ONLY`` defined it declares and defines nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from skyarm.compile.c.c_source import END_IEEE, KEEP_IEEE, Floats, helpers, statements
from skyarm.compile.c.c_struct import Struct, comment, declaration, initialiser
from skyarm.compile.tracing.lower import Lowered


@dataclass(frozen=True, kw_only=True, slots=True)
class StepFile:
    """What the file is made of.

    Attributes:
        name: begins every name that others see, a C identifier.
        floats: type of every number.
        program: inputs in the order parameters, then ``inputs``, then memory; outputs in the order memory, ``output``.
        structs: of "parameters", "memory", of each of ``inputs`` and of ``output``.
        notes: one line on each struct.
        inputs: names of the structs that a call only reads. output: name of the struct that it only writes.
    """

    name: str
    floats: Floats
    program: Lowered
    structs: Mapping[str, Struct]
    notes: Mapping[str, str]
    inputs: tuple[str, ...]
    output: str

    def text(self, opening: Sequence[str]) -> str:
        """The whole file; ``opening`` are the lines of its first comment."""
        return "\n".join([_comment(opening), self._interface(), self._implementation()])

    def _interface(self) -> str:
        name = self.name
        guard = f"{name.upper()}_INTERFACE"
        lines = [f"#ifndef {guard}", f"#define {guard}", "", "#ifdef __cplusplus", 'extern "C" {', "#endif", ""]
        for key in (*self.inputs, "memory", self.output, "parameters"):
            lines += [f"/* {self.notes[key]} */", declaration(f"{name}_{key}", self.structs[key], self.floats), ""]
        lines += [
            *(f"extern {constant};" for constant in self._constants()),
            "",
            "/* One step with the default parameters. */",
            f"{self._signature('step', tuned=False)};",
            "",
            "/* One step with parameters of your own. */",
            f"{self._signature('step_with', tuned=True)};",
            "",
            *("#ifdef __cplusplus", "}", "#endif", "#endif", ""),
        ]
        return "\n".join(lines)

    def _constants(self) -> tuple[str, str]:
        name = self.name
        return (
            f"const struct {name}_parameters {name}_default_parameters",
            f"const struct {name}_memory {name}_first_memory",
        )

    def _signature(self, function: str, *, tuned: bool) -> str:
        read = (*(("parameters",) if tuned else ()), *self.inputs)
        arguments = [f"const struct {self.name}_{key} *{key}" for key in read]
        arguments += [f"struct {self.name}_{key} *{key}" for key in ("memory", self.output)]
        return f"void {self.name}_{function}(\n    " + ",\n    ".join(arguments) + ")"

    def _implementation(self) -> str:
        name, structs, floats = self.name, self.structs, self.floats
        read = ("parameters", *self.inputs, "memory")
        inputs = [_place(key, place) for key in read for place in structs[key].places]
        outputs = [_place(key, place) for key in ("memory", self.output) for place in structs[key].places]
        body = [f"(void){key};" for key in (*read, self.output)]
        body += statements(self.program, floats, name, inputs, outputs)
        values = (structs["parameters"], structs["memory"])
        lines = [f"#ifndef {name.upper()}_INTERFACE_ONLY", "#include <math.h>", "", KEEP_IEEE]
        for constant, struct in zip(self._constants(), values, strict=True):
            lines += [f"{constant} = {initialiser(struct, floats)};", ""]
        lines += [
            helpers(self.program, floats, name),
            *(self._signature("step_with", tuned=True), "{", *(f"    {line}" for line in body), "}", ""),
            *(self._signature("step", tuned=False), "{"),
            f"    {name}_step_with(&{name}_default_parameters, {', '.join((*self.inputs, 'memory', self.output))});",
            *("}", "", END_IEEE, "#endif", ""),
        ]
        return "\n".join(lines)


def _place(key: str, place: str | None) -> str:
    # a leaf without a place is one that the program does not read
    return f"{key}->{place}" if place else "0"


def _comment(lines: Sequence[str]) -> str:
    indented = [" " * (len(line) - len(line.lstrip())) + comment(line) for line in lines]
    return "\n".join(["/*", *(f" * {line}".rstrip() for line in indented), " */"])
