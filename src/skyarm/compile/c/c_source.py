"""C99 text of straight-line programs: one assignment an operation, nothing of the library but math.h.

Compiled without contraction (GCC: ``-std=c99`` or ``-ffp-contract=off``) a double program has the bits of the Python
floats; with it, a * b + c becomes one rounding. Every operation is IEEE's: infinities and NaN pass through.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass

from skyarm.compile.tracing.lower import Lowered
from skyarm.compile.tracing.tracer import Node

INFIX = {"add": "+", "sub": "-", "mul": "*", "div": "/", "lt": "<", "le": "<=", "and": "&&", "or": "||"}
LIBRARY = {"abs": "fabs", "sqrt": "sqrt", "floor": "floor", "copysign": "copysign"}
CONDITIONS = frozenset({"lt", "le", "and", "or", "not"})

HELPERS = {
    "power_of_two": """\
/* 2^k of a whole k; the bounds keep the conversion to int defined. */
static {kind} {name}({kind} k)
{{
    return k > {low} && k < {high} ? {ldexp}({one}, (int)k) : ({kind})NAN;
}}
""",
    "exponent": """\
/* Whole e with |x| = m 2^e and 1 <= m < 2. */
static {kind} {name}({kind} x)
{{
    int e;
    if (!isfinite(x) || !(x < {zero} || x > {zero}))
        return ({kind})NAN;
    (void){frexp}(x, &e);
    return ({kind})(e - 1);
}}
""",
    "mantissa": """\
/* m of |x| = m 2^e with 1 <= m < 2, with the sign of x. */
static {kind} {name}({kind} x)
{{
    int e;
    if (!isfinite(x) || !(x < {zero} || x > {zero}))
        return ({kind})NAN;
    return {two} * {frexp}(x, &e);
}}
""",
}
"""Operations that C writes as a function, equal to :mod:`skyarm.scalars.floats`, subnormal numbers included."""

FAST = "#if defined(__FAST_MATH__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__)"

KEEP_IEEE = f"""\
{FAST}
/* NaN must stay visible and every operation keep its rounding: fast-math is taken back for this code. */
#if defined(__clang__)
#pragma float_control(push)
#pragma float_control(precise, on)
#elif defined(__GNUC__)
#pragma GCC push_options
#pragma GCC optimize ("no-fast-math")
#endif
#endif
"""
"""Before the code."""

END_IEEE = f"""\
{FAST}
#if defined(__clang__)
#pragma float_control(pop)
#elif defined(__GNUC__)
#pragma GCC pop_options
#endif
#endif
"""
"""After it: a program that includes the file keeps its own flags."""


@dataclass(frozen=True, slots=True)
class Floats:
    """The floating-point numbers of a file: double, or float if ``single``."""

    single: bool = False

    @property
    def kind(self) -> str:
        """C type."""
        return "float" if self.single else "double"

    def function(self, name: str) -> str:
        """Name of a function of math.h for this type."""
        return f"{name}f" if self.single else name

    def literal(self, value: float) -> str:
        """A number that reads back as itself, rounded to the type; negative ones in parentheses."""
        if self.single:
            try:
                value = struct.unpack("<f", struct.pack("<f", value))[0]
            except OverflowError:
                value = math.copysign(math.inf, value)
        if math.isnan(value):
            return f"({self.kind})NAN"
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
    """Definitions of the functions the program's statements call, named ``prefix`` and the operation."""
    used = {node.op for node in program.nodes}
    numbers = {"zero": 0.0, "one": 1.0, "two": 2.0, "low": -1100.0, "high": 1100.0}
    words = {name: floats.literal(value) for name, value in numbers.items()}
    words |= {name: floats.function(name) for name in ("ldexp", "frexp")}
    texts = [
        text.format(kind=floats.kind, name=f"{prefix}_{op}", **words) for op, text in HELPERS.items() if op in used
    ]
    return "\n".join(texts)


def statements(
    program: Lowered, floats: Floats, prefix: str, inputs: Sequence[str], outputs: Sequence[str]
) -> list[str]:
    """Lines of a function's body: inputs are read, then operations in order, then outputs are written.

    Args:
        program: basic operations.
        floats: type of every number.
        prefix: of the functions of :func:`helpers`.
        inputs: C expression of each input; one that the program does not use is not read.
        outputs: C place of each output. All reading is done before the first writing, so places may be inputs too.
    """
    names: dict[int, str] = {}
    conditions: set[int] = set()
    lines: list[str] = []
    live = {node.index for node in program.nodes}
    for node, expression in zip(program.inputs, inputs, strict=True):
        if node.index in live:
            names[node.index] = f"v{node.index}"
            lines.append(f"const {floats.kind} v{node.index} = {expression};")
    for node in program.nodes:
        if _is_condition(node, conditions):
            conditions.add(node.index)
        if node.op == "const":
            truth = isinstance(node.value, bool)
            names[node.index] = str(int(node.value)) if truth else floats.literal(node.value)
        elif node.op != "input":
            kind = "int" if node.index in conditions else floats.kind
            value = _expression(node, [names[arg.index] for arg in node.args], floats, prefix)
            names[node.index] = f"v{node.index}"
            lines.append(f"const {kind} v{node.index} = {value};")
    lines += [f"{place} = {names[node.index]};" for node, place in zip(program.outputs, outputs, strict=True)]
    return lines


def _is_condition(node: Node, known: set[int]) -> bool:
    if node.op == "where":
        return node.args[1].index in known
    return node.op in CONDITIONS or isinstance(node.value, bool)


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
