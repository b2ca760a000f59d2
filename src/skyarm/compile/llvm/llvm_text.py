"""LLVM assembly of straight-line programs on SIMD vectors: one instruction per
operation and vector.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import dataclass, field

from skyarm.algebra.scalars.floats import to_single
from skyarm.compile.tracing.lower import arrange
from skyarm.compile.tracing.tracer import Node, is_condition
from skyarm.records.immutable import positional

ARITHMETIC = {"add": "fadd", "sub": "fsub", "mul": "fmul", "div": "fdiv"}
COMPARISON = {"lt": "olt", "le": "ole"}
LOGIC = {"and": "and", "or": "or"}
INTRINSIC = {"abs": "fabs", "sqrt": "sqrt", "floor": "floor", "copysign": "copysign"}


@positional
class Lanes:
    """Shape of a SIMD vector: number of lanes and floating-point precision.

    Attributes:
        width: lanes per vector. single: 32-bit floats in place of 64-bit ones.
        contract: let a * b + c become one rounding and, on x86, numbers below the
            normal range zero (faster, not bit-equal to Python).
    """

    width: int
    single: bool = False
    contract: bool = False

    @property
    def scalar(self) -> str:
        """LLVM type of one element of a SIMD vector."""
        return "float" if self.single else "double"

    def vector_of(self, scalar: str) -> str:
        """LLVM type of a SIMD vector of a scalar type; of one lane that type itself:
        LLVM compiles it twice as fast.
        """
        return scalar if self.width == 1 else f"<{self.width} x {scalar}>"

    @property
    def vector(self) -> str:
        """LLVM type of a SIMD vector of floats."""
        return self.vector_of(self.scalar)

    @property
    def mask(self) -> str:
        """LLVM type of a SIMD vector of truth values (i1)."""
        return self.vector_of("i1")

    @property
    def integer(self) -> str:
        """LLVM type of a SIMD vector of integers with as many bits as the floats."""
        return self.vector_of("i32" if self.single else "i64")

    @property
    def suffix(self) -> str:
        """Type suffix of the vector in names of LLVM intrinsics."""
        scalar = "f32" if self.single else "f64"
        return scalar if self.width == 1 else f"v{self.width}{scalar}"

    @property
    def bytes(self) -> int:
        """Size (bytes) of one element of a SIMD vector."""
        return 4 if self.single else 8

    def constant(self, value: float) -> str:
        """LLVM constant with the same number in every SIMD lane, rounded to single
        precision if needed.
        """
        if self.single:
            value = to_single(value)
        # LLVM writes constants of 32 bits with the digits of a double, too
        bits = struct.unpack("<Q", struct.pack("<d", value))[0]
        return self.splat(f"{self.scalar} 0x{bits:016X}")

    def splat(self, lane: str) -> str:
        """LLVM constant with the same typed value in every SIMD lane."""
        return (
            lane.partition(" ")[2]
            if self.width == 1
            else f"<{', '.join([lane] * self.width)}>"
        )

    def integers(self, value: int) -> str:
        """LLVM constant with the same integer in every SIMD lane."""
        return self.splat(f"i{32 if self.single else 64} {value}")


@dataclass(slots=True)
class Writer:
    """Writer of an LLVM function: lines of assembly so far, and the name of each
    operation's result.

    Attributes:
        functions: lines of the shared functions that are called, by the identity of
            each.
        block: label that the last instruction is under.
    """

    lanes: Lanes
    lines: list[str] = field(default_factory=list)
    names: dict[int, str] = field(default_factory=dict)
    intrinsics: set[str] = field(default_factory=set)
    functions: dict[int, list[str]] = field(default_factory=dict)
    block: str = "entry"
    _count: int = 0

    def fresh(self) -> str:
        """Make a new local name that is unique in the function."""
        self._count += 1
        return f"%t{self._count}"

    def emit(self, text: str) -> str:
        """Write one instruction that yields a value; returns the value's name."""
        name = self.fresh()
        self.lines.append(f"  {name} = {text}")
        return name

    def do(self, text: str) -> None:
        """Write instructions without a result, or labels, one per line."""
        self.lines += [line for line in text.split("\n") if line]

    def broadcast(self, name: str, scalar: str) -> str:
        """Write assembly that copies a scalar of a type into all SIMD lanes; returns
        the vector's name.
        """
        lanes = self.lanes
        vector = self.lanes.vector_of(scalar)
        if lanes.width == 1:
            return name
        # other elements may be anything: the shuffle reads the first alone
        first = self.emit(f"insertelement {vector} poison, {scalar} {name}, i64 0")
        zeros = f"{lanes.vector_of('i32')} {lanes.splat('i32 0')}"
        return self.emit(f"shufflevector {vector} {first}, {vector} poison, {zeros}")

    def program(self, nodes: Iterable[Node]) -> None:
        """Write the assembly of all operations of a traced program."""
        for node, body in arrange(nodes):
            if node.op == "repeat":
                self._loop(node, body)
            elif node.op == "apply":
                self._apply(node)
            elif node.op in ("item", "result"):
                self.names[node.index] = f"%r{node.args[0].index}.e{node.value}"
            elif node.index not in self.names:
                self.names[node.index] = self._value(node)

    def _loop(self, block: Node, body: Iterable[Node]) -> None:
        """Write the assembly of a loop, which ends once no SIMD lane needs another
        iteration.
        """
        count, slots, until = block.value
        label = f"r{block.index}"
        vector = self.lanes.vector
        starts = [self.names[arg.index] for arg in block.args[: len(slots)]]
        for k, slot in enumerate(slots):
            self.names[slot.index] = f"%{label}.s{k}"
        self.lines += [f"  br label %{label}.entry", f"{label}.entry:"]
        begun = "true" if until is None else self._goes_on(starts[until])
        self.lines += [
            f"  br i1 {begun}, label %{label}, label %{label}.exit",
            f"{label}:",
        ]
        heads = len(self.lines)
        self.block = label
        self.program(body)
        ends = [self.names[arg.index] for arg in block.args[len(slots) :]]
        # phis come first in a block, but name what its end computes
        phis = [
            f" = phi {vector} [ {start}, %{label}.entry ], [ {end}, %{self.block} ]"
            for start, end in zip(starts, ends, strict=True)
        ]
        count_phi = (
            f" = phi i64 [ 1, %{label}.entry ], [ %{label}.next, %{self.block} ]"
        )
        self.lines[heads:heads] = [
            f"  %{label}.i{count_phi}",
            *(f"  %{label}.s{k}{phi}" for k, phi in enumerate(phis)),
        ]
        self.lines += [
            f"  %{label}.next = add i64 %{label}.i, 1",
            f"  %{label}.more = icmp slt i64 %{label}.i, {count}",
        ]
        more = f"%{label}.more"
        if until is not None:
            more = self.emit(f"and i1 {more}, {self._goes_on(ends[until])}")
        self.lines += [
            f"  br i1 {more}, label %{label}, label %{label}.exit",
            f"{label}.exit:",
        ]
        self.lines += [f"  %{label}.e{k}{phi}" for k, phi in enumerate(phis)]
        self.block = f"{label}.exit"

    def scratch(self, nodes: Iterable[Node]) -> None:
        """Write assembly that reserves memory for arguments and results of the shared
        functions that nodes call.
        """
        # one area for all calls: results are read before the next call writes
        # aligned to 64 bytes, the widest vector of host_width
        sizes = [
            max(len(node.args), len(node.value.outputs))
            for node in nodes
            if node.op == "apply"
        ]
        if sizes:
            self.do(
                f"  %scratch = alloca [{max(sizes)} x {self.lanes.vector}], align 64"
            )

    def _cell(self, k: int) -> str:
        """Write assembly for the address of a number in the scratch memory; returns its
        name.
        """
        return self.emit(f"getelementptr {self.lanes.vector}, ptr %scratch, i64 {k}")

    def _apply(self, call: Node) -> None:
        """Write the assembly of a call of a shared function, and of that function if
        this is its first call.

        Where the call has a condition it is skipped if that holds in no SIMD lane.
        """
        function = call.value
        label = f"r{call.index}"
        vector = self.lanes.vector
        if id(function) not in self.functions:
            lines = self.functions[id(function)] = list[str]()
            inner = Writer(self.lanes, lines, {}, self.intrinsics, self.functions)
            name = f"@shared{len(self.functions)}"
            # inlined the code would be written as often as it is called
            inner.do(
                f"define internal void {name}(ptr noalias %numbers) noinline {{\nentry:"
            )
            inner.scratch(function.nodes)
            for k, node in enumerate(function.inputs):
                at = inner.emit(f"getelementptr {vector}, ptr %numbers, i64 {k}")
                inner.names[node.index] = inner.emit(f"load {vector}, ptr {at}")
            inner.program(function.nodes)
            for k, node in enumerate(function.outputs):
                at = inner.emit(f"getelementptr {vector}, ptr %numbers, i64 {k}")
                inner.do(f"  store {vector} {inner.names[node.index]}, ptr {at}")
            inner.do("  ret void\n}")
        name = f"@shared{1 + list(self.functions).index(id(function))}"
        given = [self.names[arg.index] for arg in call.args]
        only, others = (
            given[len(function.inputs) :][:1],
            given[len(function.inputs) + 1 :],
        )
        if only:
            some = self._any(*only)
            self.do(f"  br label %{label}.entry\n{label}.entry:")
            self.do(f"  br i1 {some}, label %{label}, label %{label}.exit\n{label}:")
        for k, arg in enumerate(given[: len(function.inputs)]):
            self.do(f"  store {vector} {arg}, ptr {self._cell(k)}")
        self.do(f"  call void {name}(ptr %scratch)")
        if not only:
            for k, _ in enumerate(function.outputs):
                self.do(f"  %{label}.e{k} = load {vector}, ptr {self._cell(k)}")
            return
        mask = f"{self.lanes.mask} {only[0]}"
        chosen = [
            self.emit(
                f"select {mask}, {vector}"
                f" {self.emit(f'load {vector}, ptr {self._cell(k)}')}, {vector} {other}"
            )
            for k, other in enumerate(others)
        ]
        self.block = f"{label}.exit"
        self.do(f"  br label %{self.block}\n{self.block}:")
        for k, (new, other) in enumerate(zip(chosen, others, strict=True)):
            self.do(
                f"  %{label}.e{k} = phi {vector} [ {new}, %{label} ],"
                f" [ {other}, %{label}.entry ]"
            )

    def _goes_on(self, left: str) -> str:
        """Write assembly of the condition (i1) that any SIMD lane needs another
        iteration; returns its name.
        """
        # a number of rounds, whole but for its type: above 0.5 it is at least 1
        return self._any(
            self.emit(
                f"fcmp ogt {self.lanes.vector} {left}, {self.lanes.constant(0.5)}"
            )
        )

    def _any(self, condition: str) -> str:
        """Write assembly of the condition (i1) that a mask is true in any SIMD lane;
        returns its name.
        """
        if self.lanes.width == 1:
            return condition
        name = f"@llvm.vector.reduce.or.v{self.lanes.width}i1"
        self.intrinsics.add(f"declare i1 {name}({self.lanes.mask})")
        return self.emit(f"call i1 {name}({self.lanes.mask} {condition})")

    def _value(self, node: Node) -> str:
        lanes = self.lanes
        op = node.op
        if op == "const":
            if is_condition(node):
                return lanes.splat(f"i1 {int(node.value)}")
            return lanes.constant(node.value)
        args = [self.names[arg.index] for arg in node.args]
        vector = lanes.vector
        flags = "contract " if lanes.contract else ""
        if op in ARITHMETIC:
            return self.emit(f"{ARITHMETIC[op]} {flags}{vector} {args[0]}, {args[1]}")
        if op == "neg":
            return self.emit(f"fneg {vector} {args[0]}")
        if op in COMPARISON:
            return self.emit(f"fcmp {COMPARISON[op]} {vector} {args[0]}, {args[1]}")
        if op in LOGIC:
            return self.emit(f"{LOGIC[op]} {lanes.mask} {args[0]}, {args[1]}")
        if op == "not":
            return self.emit(f"xor {lanes.mask} {args[0]}, {lanes.splat('i1 1')}")
        if op == "where":
            # both branches may be conditions themselves
            kind = lanes.mask if is_condition(node.args[1]) else vector
            return self.emit(
                f"select {lanes.mask} {args[0]}, {kind} {args[1]}, {kind} {args[2]}"
            )
        if op in INTRINSIC:
            return self.intrinsic(INTRINSIC[op], *args)
        bitwise = {
            "power_of_two": self._power_of_two,
            "exponent": self._exponent,
            "mantissa": self._mantissa,
        }
        return bitwise[op](*args)

    def intrinsic(self, name: str, *args: str) -> str:
        """Write a call of an LLVM vector intrinsic; returns the name of its result."""
        lanes = self.lanes
        full = f"@llvm.{name}.{lanes.suffix}"
        self.intrinsics.add(
            f"declare {lanes.vector} {full}({', '.join([lanes.vector] * len(args))})"
        )
        return self.emit(
            f"call {lanes.vector}"
            f" {full}({', '.join(f'{lanes.vector} {arg}' for arg in args)})"
        )

    def _power_of_two(self, k: str) -> str:
        """Write assembly of 2**k for integers k stored as floats; returns the name of
        the result.
        """
        lanes = self.lanes
        shift, bias, magic = (
            (23, 127, 12582912.0) if lanes.single else (52, 1023, 6755399441055744.0)
        )
        if lanes.single:
            # exp halves k for the range of doubles; past that of floats it must be inf
            # or 0, not a wrapped exponent
            k = self.intrinsic(
                "minnum",
                self.intrinsic("maxnum", k, lanes.constant(-127.0)),
                lanes.constant(128.0),
            )
        # 1.5 times 2 to the fraction's bits: the sum has the integer in its low bits
        moved = self.emit(f"fadd {lanes.vector} {k}, {lanes.constant(magic)}")
        bits = self.emit(f"bitcast {lanes.vector} {moved} to {lanes.integer}")
        up = self.emit(f"shl {lanes.integer} {bits}, {lanes.integers(shift)}")
        biased = self.emit(f"add {lanes.integer} {up}, {lanes.integers(bias << shift)}")
        return self.emit(f"bitcast {lanes.integer} {biased} to {lanes.vector}")

    def _exponent(self, x: str) -> str:
        """Write assembly of the binary exponent of a normal number, as a float; returns
        its name.
        """
        lanes = self.lanes
        shift, bias, field_mask = (23, 127, 0xFF) if lanes.single else (52, 1023, 0x7FF)
        # the biased exponent of IEEE formats stands above the fraction
        bits = self.emit(f"bitcast {lanes.vector} {x} to {lanes.integer}")
        down = self.emit(f"lshr {lanes.integer} {bits}, {lanes.integers(shift)}")
        field = self.emit(f"and {lanes.integer} {down}, {lanes.integers(field_mask)}")
        number = self.emit(f"sitofp {lanes.integer} {field} to {lanes.vector}")
        return self.emit(f"fsub {lanes.vector} {number}, {lanes.constant(float(bias))}")

    def _mantissa(self, x: str) -> str:
        """Write assembly of the binary mantissa of a number; returns its name."""
        lanes = self.lanes
        # sign and fraction are kept, under the exponent of 1.0
        keep, one = (
            (0x807FFFFF, 0x3F800000)
            if lanes.single
            else (0x800FFFFFFFFFFFFF, 0x3FF0000000000000)
        )
        bits = self.emit(f"bitcast {lanes.vector} {x} to {lanes.integer}")
        fraction = self.emit(f"and {lanes.integer} {bits}, {lanes.integers(keep)}")
        set_ = self.emit(f"or {lanes.integer} {fraction}, {lanes.integers(one)}")
        return self.emit(f"bitcast {lanes.integer} {set_} to {lanes.vector}")
