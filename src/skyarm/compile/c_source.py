"""C99 source of a traced program: statements, structs of dataclasses, and a file with
one step function.

One assignment an operation, nothing of the library but math.h. The file switches
contraction off on GCC, clang and MSVC, so that a double program has the bits of the
Python floats; elsewhere a * b + c may become one rounding. Every operation is IEEE's:
infinities and NaN pass through, and a build with fast-math ends in an error. A file is
its own header: with ``NAME_INTERFACE_ONLY`` defined it declares and defines nothing.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from skyarm.algebra import Mat3, Quaternion, Sym3, Vec3
from skyarm.algebra.scalars.floats import to_single
from skyarm.compile.tracing.tracer import Lowered, Node, is_condition
from skyarm.records.arrays import Array
from skyarm.records.immutable import immutable, positional
from skyarm.records.leaves import Place, Tree, is_leaf, is_record, parts, walk
from skyarm.records.units import Unit, units

INFIX = {
    "add": "+",
    "sub": "-",
    "mul": "*",
    "div": "/",
    "lt": "<",
    "le": "<=",
    "and": "&&",
    "or": "||",
}
LIBRARY = {"abs": "fabs", "sqrt": "sqrt", "floor": "floor", "copysign": "copysign"}

HELPERS = {
    "power_of_two": (
        """\
/* 2^k of a whole k; the bounds keep the conversion to int defined. */
static {kind} {name}({kind} k)
{{
    return k > {low} && k < {high} ? {ldexp}({one}, (int)k) : ({kind})NAN;
}}
"""
    ),
    "exponent": (
        """\
/* Whole e with |x| = m 2^e and 1 <= m < 2. */
static {kind} {name}({kind} x)
{{
    int e;
    if (!isfinite(x) || !(x < {zero} || x > {zero}))
        return ({kind})NAN;
    (void){frexp}(x, &e);
    return ({kind})(e - 1);
}}
"""
    ),
    "mantissa": (
        """\
/* m of |x| = m 2^e with 1 <= m < 2, with the sign of x. */
static {kind} {name}({kind} x)
{{
    int e;
    if (!isfinite(x) || !(x < {zero} || x > {zero}))
        return ({kind})NAN;
    return {two} * {frexp}(x, &e);
}}
"""
    ),
}
"""C helper functions by operation, equal to :mod:`skyarm.algebra.scalars.floats` also
for subnormal numbers."""

KEEP_IEEE = """\
/* NaN must stay visible and every operation keep its rounding. */
#if defined(__FAST_MATH__) || defined(_M_FP_FAST) \
|| (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__) \\
    || defined(__ASSOCIATIVE_MATH__) || defined(__RECIPROCAL_MATH__)
#error "compile without -ffast-math, -ffinite-math-only, -funsafe-math-optimizations \
or /fp:fast: this code must see NaN and round every operation"
#endif
/* a * b + c rounds twice, as in Python. */
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__)
#pragma GCC push_options
#pragma GCC optimize ("fp-contract=off")
#elif defined(_MSC_VER)
#pragma fp_contract (off)
#endif
"""
"""C text before the generated code: it refuses fast-math and switches contraction
off."""

END_IEEE = """\
#if defined(__clang__)
#pragma STDC FP_CONTRACT DEFAULT
#elif defined(__GNUC__)
#pragma GCC pop_options
#elif defined(_MSC_VER)
#pragma fp_contract (on)
#endif
"""
"""C text after the generated code: it restores the compiler flags of a program that
includes the file."""


@positional
class Floats:
    """C floating-point type of a generated file: double, or float if ``single``."""

    single: bool = False

    @property
    def kind(self) -> str:
        """Name of the C floating-point type: double or float."""
        return "float" if self.single else "double"

    def function(self, name: str) -> str:
        """Name of a math.h function for the floating-point type, such as sin or
        sinf.
        """
        return f"{name}f" if self.single else name

    def literal(self, value: float) -> str:
        """C literal of a number, exact after rounding to the type; negative numbers in
        parentheses.
        """
        if self.single:
            value = to_single(value)
        if math.isnan(value):
            return f"({self.kind})NAN"
        # the sign bit, since -0.0 < 0 is false
        minus = math.copysign(1.0, value) < 0.0
        size = abs(value)
        text = f"({self.kind})INFINITY" if math.isinf(size) else self._digits(size)
        return f"(-{text})" if minus else text

    def _digits(self, size: float) -> str:
        text = f"{size:.9g}" if self.single else repr(size)
        if not set(text) & set(".e"):
            text += ".0"
        return f"{text}f" if self.single else text


def helpers(program: Lowered, floats: Floats, prefix: str) -> str:
    """C definitions of the helper functions, named ``prefix_operation``, that a
    program's statements call.
    """
    used = {node.op for node in program.nodes}
    # beyond all exponents of a double (-1074 to 1023), as in floats.power_of_two
    numbers = {"zero": 0.0, "one": 1.0, "two": 2.0, "low": -1100.0, "high": 1100.0}
    spelled = {name: floats.literal(value) for name, value in numbers.items()}
    spelled |= {name: floats.function(name) for name in ("ldexp", "frexp")}
    texts = [
        text.format(kind=floats.kind, name=f"{prefix}_{op}", **spelled)
        for op, text in HELPERS.items()
        if op in used
    ]
    return "\n".join(texts)


def statements(
    program: Lowered,
    floats: Floats,
    prefix: str,
    inputs: Sequence[str],
    outputs: Sequence[str],
) -> list[str]:
    """C statements of a function body that evaluates a traced program from its inputs
    to its outputs.

    Args:
        program: basic operations.
        floats: type of every number.
        prefix: first part of the names of the functions of :func:`helpers`.
        inputs: C expression of each input; one that the program does not use is not
            read.
        outputs: C place of each output. All reading is done before the first writing,
            so places may be inputs too.
    """
    names: dict[int, str] = {}
    lines: list[str] = []
    live = {node.index for node in program.nodes}
    for node, expression in zip(program.inputs, inputs, strict=True):
        if node.index in live:
            names[node.index] = f"v{node.index}"
            lines.append(f"const {floats.kind} v{node.index} = {expression};")
    for node in program.nodes:
        if node.op == "const":
            names[node.index] = (
                str(int(node.value))
                if is_condition(node)
                else floats.literal(node.value)
            )
        elif node.op != "input":
            kind = "int" if is_condition(node) else floats.kind
            value = _expression(
                node, [names[arg.index] for arg in node.args], floats, prefix
            )
            names[node.index] = f"v{node.index}"
            lines.append(f"const {kind} v{node.index} = {value};")
    lines += [
        f"{place} = {names[node.index]};"
        for node, place in zip(program.outputs, outputs, strict=True)
    ]
    return lines


def _expression(node: Node, args: list[str], floats: Floats, prefix: str) -> str:
    op = node.op
    if op in INFIX:
        return f"{args[0]} {INFIX[op]} {args[1]}"
    if op == "neg":
        return f"-{args[0]}"
    if op == "not":
        return f"!{args[0]}"
    if op == "where":
        return f"{args[0]} ? {args[1]} : {args[2]}"
    function = floats.function(LIBRARY[op]) if op in LIBRARY else f"{prefix}_{op}"
    return f"{function}({', '.join(args)})"


VECTORS = (Vec3, Quaternion, Sym3, Mat3)

Units = Mapping[Place, Mapping[str, Unit]]
"""Units of dataclass fields, by path of the dataclass and name of the field."""


@positional
class RecordField:
    """Field of a dataclass that becomes a member of a C struct: path, unit, array sizes
    and scalars.

    Attributes:
        path: place in the record, for example ("links", "0", "body", "mass").
        note: unit and meaning of its numbers.
        shape: () for a scalar, (3,) for a vector, (4, 4) for rows. entries: (place,
            value) of all, structural ones too.
    """

    path: Place
    note: str
    shape: tuple[int, ...]
    entries: tuple[tuple[Place, Tree], ...]


@positional
class StructMember:
    """Member of a C struct: name, array sizes, comment, initial values."""

    name: str
    shape: tuple[int, ...]
    note: str
    values: tuple[float, ...]


@positional
class Struct:
    """C struct of a dataclass: its members, and the C name of each scalar of the
    dataclass (None if left out).
    """

    members: tuple[StructMember, ...]
    places: tuple[str | None, ...]


def fields(
    record: Tree, others: Units = MappingProxyType({}), path: Place = (), note: str = ""
) -> Iterator[RecordField]:
    """List the fields of a nested dataclass that contain scalars, in the order of the
    scalars.
    """
    if isinstance(record, VECTORS) or _grid(record):
        yield RecordField(path, note, _shape(record), tuple(walk(record)))
    elif isinstance(record, tuple) or is_record(record):
        said = others.get(path) or (units(type(record)) if is_record(record) else {})
        # elements of a tuple have no units of their own: they keep its note
        for name, value in parts(record).items():
            own = note
            if not isinstance(record, tuple):
                own = said[name].words if name in said else ""
            yield from fields(value, others, (*path, name), own)
    elif is_leaf(record):
        yield RecordField(path, note, (), (((), record),))


def _grid(value: Tree) -> bool:
    """True for a tuple of scalars, or a tuple of equally long tuples of scalars: a one-
    or two-dimensional array.
    """
    if not isinstance(value, tuple):
        return False
    rows = [item if isinstance(item, tuple) else (item,) for item in value]
    plain = all(isinstance(x, (float, int)) for row in rows for x in row)
    lengths = {len(row) for row in rows}
    # C99 knows no array without elements
    return (
        plain
        and len(lengths) == 1
        and 0 not in lengths
        and len({isinstance(item, tuple) for item in value}) == 1
    )


def _shape(value: Tree) -> tuple[int, ...]:
    if isinstance(value, tuple):
        return (
            (len(value), len(value[0]))
            if isinstance(value[0], tuple)
            else (len(value),)
        )
    return (3, 3) if isinstance(value, Mat3) else (len(parts(value)),)


def make_struct(
    record: Tree,
    name: Callable[[Place], str],
    keep: Sequence[bool],
    others: Units = MappingProxyType({}),
) -> Struct:
    """C struct of a dataclass, with the units of the fields as comments.

    Args:
        record: its leaves give the values.
        name: a member's name from a path.
        keep: True for each leaf to include; a vector that is not included as a whole,
            or holds structure, falls into members of its own.
        others: units of records, by place, whose fields mean something else there than
            they say.

    Raises:
        ValueError: two fields get one name.
    """
    members: list[StructMember] = []
    places: list[str | None] = []
    for field in fields(record, others):
        leaves = [(place, value) for place, value in field.entries if is_leaf(value)]
        included = [keep[len(places) + i] for i in range(len(leaves))]
        # a vector stays one member only if all of it is included
        if len(leaves) == len(field.entries) and all(included):
            own = name(field.path)
            members.append(
                StructMember(
                    own,
                    field.shape,
                    field.note,
                    tuple(float(value) for _, value in leaves),
                )
            )
            places += [own + index for index in _indices(field.shape)]
            continue
        for (place, value), include in zip(leaves, included, strict=True):
            own = name((*field.path, *place))
            places.append(own if include else None)
            if include:
                members.append(StructMember(own, (), field.note, (float(value),)))
    repeated = {
        member.name
        for member in members
        if sum(other.name == member.name for other in members) > 1
    }
    if repeated:
        raise ValueError(f"struct: fields share the names {sorted(repeated)}")
    return Struct(tuple(members), tuple(places))


def _indices(shape: tuple[int, ...]) -> list[str]:
    """Indices of all elements of a C array, row by row."""
    return ["".join(f"[{i}]" for i in index) for index in np.ndindex(shape)]


def declaration(name: str, struct: Struct, floats: Floats) -> str:
    """C declaration ``struct name { ... };``; a struct without members gets a
    placeholder member.
    """
    members = struct.members or (
        StructMember("reserved", (), "not used: C99 knows no empty struct", (0.0,)),
    )
    lines = [f"struct {name} {{"]
    for member in members:
        sizes = "".join(f"[{size}]" for size in member.shape)
        note = f" /* {comment(member.note)} */" if member.note else ""
        lines.append(f"    {floats.kind} {member.name}{sizes};{note}")
    return "\n".join([*lines, "};"])


def initialiser(struct: Struct, floats: Floats) -> str:
    """C initialiser ``{ ... }`` with the values of a struct, one member a line."""
    if not struct.members:
        return f"{{{floats.literal(0.0)}}}"
    lines = [
        f"    {_in_braces(np.reshape(member.values, member.shape), floats)}, /*"
        f" {member.name} */"
        for member in struct.members
    ]
    return "\n".join(["{", *lines, "}"])


def _in_braces(values: Array, floats: Floats) -> str:
    if not values.ndim:
        return floats.literal(float(values))
    return f"{{{', '.join(_in_braces(np.asarray(each), floats) for each in values)}}}"


def comment(text: str) -> str:
    """Text that is safe inside a C comment: one line of printable ASCII characters."""
    plain = re.sub(r"[^ -~]|[?\\]", "_", " ".join(text.split()))
    return re.sub(r"\*(?=/)|/(?=\*)", "_", plain)


@immutable
class StepFile:
    """Contents of a generated C file with the step function of a controller.

    Attributes:
        name: begins every name that others see, a C identifier.
        floats: type of every number.
        program: inputs in the order parameters, then ``inputs``, then memory; outputs
            in the order memory, ``output``.
        structs: structs of "parameters", "memory", each of ``inputs`` and ``output``.
        notes: one line on each struct.
        inputs: names of the structs that a call only reads. output: name of the struct
            that it only writes.
    """

    name: str
    floats: Floats
    program: Lowered
    structs: Mapping[str, Struct]
    notes: Mapping[str, str]
    inputs: tuple[str, ...]
    output: str

    def text(self, opening: Sequence[str]) -> str:
        """Text of the whole C file; ``opening``: lines of its first comment."""
        return "\n".join([_comment(opening), self._interface(), self._implementation()])

    def _interface(self) -> str:
        name = self.name
        guard = f"{name.upper()}_INTERFACE"
        lines = [
            f"#ifndef {guard}",
            f"#define {guard}",
            "",
            "#ifdef __cplusplus",
            'extern "C" {',
            "#endif",
            "",
        ]
        for key in (*self.inputs, "memory", self.output, "parameters"):
            lines += [
                f"/* {self.notes[key]} */",
                declaration(f"{name}_{key}", self.structs[key], self.floats),
                "",
            ]
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
        arguments += [
            f"struct {self.name}_{key} *{key}" for key in ("memory", self.output)
        ]
        return f"void {self.name}_{function}(\n    " + ",\n    ".join(arguments) + ")"

    def _implementation(self) -> str:
        name = self.name
        structs = self.structs
        floats = self.floats
        read = ("parameters", *self.inputs, "memory")
        inputs = [_place(key, place) for key in read for place in structs[key].places]
        outputs = [
            _place(key, place)
            for key in ("memory", self.output)
            for place in structs[key].places
        ]
        # a compiler warns of arguments that a law does not use
        body = [f"(void){key};" for key in (*read, self.output)]
        body += statements(self.program, floats, name, inputs, outputs)
        values = (structs["parameters"], structs["memory"])
        lines = [
            f"#ifndef {name.upper()}_INTERFACE_ONLY",
            "#include <math.h>",
            "",
            KEEP_IEEE,
        ]
        if not floats.single:
            needs = f"{name}_needs_64_bit_double_without_fsingle_precision_constant"
            # a negative size is an error where 0.1 is a float
            lines += [
                f"typedef char {needs}[sizeof(0.1) > sizeof(float) ? 1 : -1];",
                "",
            ]
        for constant, each in zip(self._constants(), values, strict=True):
            lines += [f"{constant} = {initialiser(each, floats)};", ""]
        lines += [
            helpers(self.program, floats, name),
            *(
                self._signature("step_with", tuned=True),
                "{",
                *(f"    {line}" for line in body),
                "}",
                "",
            ),
            *(self._signature("step", tuned=False), "{"),
            (
                f"    {name}_step_with(&{name}_default_parameters,"
                f" {', '.join((*self.inputs, 'memory', self.output))});"
            ),
            *("}", "", END_IEEE, "#endif", ""),
        ]
        return "\n".join(lines)


def _place(key: str, place: str | None) -> str:
    # a leaf without a place is one that the program does not read
    return f"{key}->{place}" if place else "0"


def _comment(lines: Sequence[str]) -> str:
    indented = [
        " " * (len(line) - len(line.lstrip())) + comment(line) for line in lines
    ]
    return "\n".join(["/*", *(f" * {line}".rstrip() for line in indented), " */"])
