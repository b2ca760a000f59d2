"""LLVM assembly of a traced loop: one function steps a block of SIMD lanes through all
rows of inputs.

    void step_loop(carry*, parameters*, rows*, log*, keys*,
                   first block, last block, begin, end, start, lanes, log every)

Rows begin to end are stepped; their random numbers are those of the steps start + begin
to start + end. Lanes are the last axis of ``carry`` and ``parameters`` (structure of
arrays); ``rows`` are shared by all lanes. What depends on parameters alone is computed
once per block, before the loop.
"""

from __future__ import annotations

import platform
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import islice

from skyarm.algebra.scalars.philox import KEY_INCREMENTS, MULTIPLIERS, ROUNDS
from skyarm.compile.llvm.llvm_text import Lanes, Writer
from skyarm.compile.tracing.program import Loop
from skyarm.compile.tracing.tracer import Lowered, Node, is_condition

LOW = 0xFFFFFFFF

Splat = Callable[[int], str]


def write_uniforms(
    writer: Writer, draws: Sequence[tuple[int, int]], *, own_seeds: bool
) -> list[str]:
    """Write assembly that draws the random numbers of a step; returns the names of the
    vectors.

    Args:
        writer: assembly of the loop's function.
        draws: (channel, how many numbers) pairs.
        own_seeds: the seed of each lane stands at ``%seeds.ptr``, in place of the one
            for all in ``%keys``.

    The function has ``%keys`` = [seed, key of every lane] as 64-bit integers,
    ``%episodes.ptr`` at this block's first key, and ``%step``. A lane's key is its
    episode in the low 32 bits and, in the high ones, what is to be added to ``%step``
    for the step of that lane (both modulo 2^32): episodes may begin at different steps.
    """
    words = writer.lanes.vector_of("i64")

    def splat(value: int) -> str:
        return writer.lanes.splat(f"i64 {value}")

    if own_seeds:
        seed = writer.emit(f"load {words}, ptr %seeds.ptr, align 8")
    else:
        seed = writer.broadcast(writer.emit("load i64, ptr %keys, align 8"), "i64")
    keys = [
        writer.emit(f"and {words} {seed}, {splat(LOW)}"),
        writer.emit(f"lshr {words} {seed}, {splat(32)}"),
    ]
    key = writer.emit(f"load {words}, ptr %episodes.ptr, align 8")
    episode = writer.emit(f"and {words} {key}, {splat(LOW)}")
    ahead = writer.emit(f"lshr {words} {key}, {splat(32)}")
    step = writer.emit(f"add {words} {writer.broadcast('%step', 'i64')}, {ahead}")
    step = writer.emit(f"and {words} {step}, {splat(LOW)}")
    numbers: list[str] = []
    for channel, count in draws:
        units: list[str] = []
        for block in range((count + 1) // 2):
            counter = [splat(block), step, splat(channel), episode]
            out = _philox(writer, words, counter, keys, splat)
            units += [
                _unit(writer, words, out[0], out[1], splat),
                _unit(writer, words, out[2], out[3], splat),
            ]
        numbers += units[:count]
    return numbers


def _philox(
    writer: Writer, words: str, counter: list[str], keys: list[str], splat: Splat
) -> list[str]:
    c0, c1, c2, c3 = counter
    k0, k1 = keys
    for index in range(ROUNDS):
        if index:
            k0, k1 = (
                writer.emit(
                    f"and {words}"
                    f" {writer.emit(f'add {words} {k}, {splat(increment)}')},"
                    f" {splat(LOW)}"
                )
                for k, increment in zip((k0, k1), KEY_INCREMENTS, strict=True)
            )
        # words of 32 bits stand in 64, since a product needs both its halves
        p0 = writer.emit(f"mul {words} {c0}, {splat(MULTIPLIERS[0])}")
        p1 = writer.emit(f"mul {words} {c2}, {splat(MULTIPLIERS[1])}")
        high0, high1 = (writer.emit(f"lshr {words} {p}, {splat(32)}") for p in (p0, p1))
        low0, low1 = (writer.emit(f"and {words} {p}, {splat(LOW)}") for p in (p0, p1))
        n0 = writer.emit(
            f"xor {words} {writer.emit(f'xor {words} {high1}, {c1}')}, {k0}"
        )
        n2 = writer.emit(
            f"xor {words} {writer.emit(f'xor {words} {high0}, {c3}')}, {k1}"
        )
        c0, c1, c2, c3 = n0, low1, n2, low0
    return [c0, c1, c2, c3]


def _unit(writer: Writer, words: str, low: str, high: str, splat: Splat) -> str:
    """Write assembly that maps 64-bit random integers to numbers in (0, 1); returns the
    vector's name.

    Single precision rounds the highest of them to 1.
    """
    lanes = writer.lanes
    double = lanes.vector_of("double")

    def number(value: str) -> str:
        return lanes.splat(f"double {value}")

    joined = writer.emit(
        f"or {words} {writer.emit(f'shl {words} {high}, {splat(32)}')}, {low}"
    )
    # 52 random bits behind the exponent of 1.0: exact, and no conversion of integers
    top = writer.emit(f"lshr {words} {joined}, {splat(12)}")
    bits = writer.emit(f"or {words} {top}, {splat(0x3FF0000000000000)}")
    shifted = writer.emit(f"bitcast {words} {bits} to {double}")
    from_zero = writer.emit(f"fsub {double} {shifted}, {number('1.0')}")
    # 2^-53: half a step, so that no number is 0
    result = writer.emit(f"fadd {double} {from_zero}, {number('0x3CA0000000000000')}")
    return (
        writer.emit(f"fptrunc {double} {result} to {lanes.vector}")
        if lanes.single
        else result
    )


NAME, CALL, BODY = "step_loop", "step_call", "step_body"

ARGUMENTS = (
    *(
        f"ptr noalias %{name}"
        for name in ("carry", "parameters", "rows", "log", "keys")
    ),
    *(
        f"i64 %{name}"
        for name in ("first", "last", "begin", "end", "start", "lanes", "every")
    ),
)

ALIGNED = 64
"""Alignment (bytes) of the stack, that of a cache line. Most numbers of a step lie
there; with the caller's alignment, three vectors of 64 bytes in four span two lines,
and flights take a fifth longer."""

FLUSH = 0x8040
"""Bits of the x86 floating-point control register that flush subnormal numbers to
zero."""


def assembly(loop: Loop, lanes: Lanes, *, logging: bool) -> str:
    """LLVM assembly text of a traced loop."""
    writer = Writer(lanes)
    inputs = iter(loop.program.inputs)
    carry, parameters, rows = (
        tuple(islice(inputs, count))
        for count in (loop.carry, loop.parameters, loop.row)
    )
    draws = tuple(inputs)
    invariant, varying = _split(loop.program.nodes, parameters)
    writer.do(
        f"define internal void @{BODY}({', '.join(ARGUMENTS)}) noinline"
        f" alignstack({ALIGNED}) {{\nentry:"
    )
    writer.scratch(loop.program.nodes)
    writer.do(f"""
  br label %blocks
blocks:
  %b = phi i64 [ %first, %entry ], [ %b.next, %next ]
  %any = icmp slt i64 %b, %last
  br i1 %any, label %block, label %done
block:
  %offset = mul i64 %b, {lanes.width}""")
    for node, name in zip(
        parameters, _load(writer, "%parameters", loop.parameters), strict=True
    ):
        writer.names[node.index] = name
    writer.program(invariant)
    starts = _load(writer, "%carry", loop.carry)
    if loop.uniforms:
        writer.do("""
  %episodes.at = getelementptr i64, ptr %keys, i64 %offset
  %episodes.ptr = getelementptr i64, ptr %episodes.at, i64 1
  %seeds.ptr = getelementptr i64, ptr %episodes.ptr, i64 %lanes""")
    # the parameters' part may have ended in another block
    writer.do("""
  br label %ready
ready:
  br label %head
head:
  %i = phi i64 [ %begin, %ready ], [ %i.next, %latch ]""")
    head = len(writer.lines)
    for i, node in enumerate(carry):
        writer.names[node.index] = f"%c{i}"
    writer.do(f"""
  %more = icmp slt i64 %i, %end
  br i1 %more, label %body, label %store
body:
  %step = add i64 %i, %start
  %line = mul i64 %i, {loop.row}
  %row = getelementptr {lanes.scalar}, ptr %rows, i64 %line""")
    used = {arg.index for node in varying for arg in node.args} | {
        node.index for node in loop.program.outputs
    }
    for i, node in enumerate(rows):
        if node.index in used:
            writer.names[node.index] = _row(writer, i)
    if loop.uniforms:
        for node, name in zip(
            draws,
            write_uniforms(writer, loop.uniforms, own_seeds=loop.own_seeds),
            strict=True,
        ):
            writer.names[node.index] = name
    writer.program(varying)
    results = [writer.names[node.index] for node in loop.program.outputs]
    if logging and loop.logged:
        _write_log(writer, results[loop.carry :])
    # phis come first in a block, but name what the step computes
    writer.lines[head:head] = [
        f"  %c{i} = phi {lanes.vector} [ {start}, %ready ], [ {end}, %latch ]"
        for i, (start, end) in enumerate(
            zip(starts, results[: loop.carry], strict=True)
        )
    ]
    writer.do(
        "  br label %latch\nlatch:\n  %i.next = add i64 %i, 1\n  br label %head\nstore:"
    )
    _store(writer, "%carry", "%offset", [f"%c{i}" for i in range(loop.carry)])
    writer.do("""
  br label %next
next:
  %b.next = add i64 %b, 1
  br label %blocks
done:
  ret void
}""")
    entry = _entry(
        flush=lanes.contract and platform.machine().lower() in ("x86_64", "amd64")
    )
    shared = [line for lines in writer.functions.values() for line in lines]
    return "\n".join(
        [*writer.lines, *shared, *entry, *_call(), *sorted(writer.intrinsics), ""]
    )


def _entry(*, flush: bool) -> list[str]:
    """Assembly of the entry function, which flushes subnormal numbers to zero if
    requested.

    A flight that settles leaves numbers below the normal range, on which some
    processors take three times as long: where bits are free anyway they become zero.
    The caller's control word comes back.
    """
    passed = ", ".join(argument.replace("noalias ", "") for argument in ARGUMENTS)
    lines = [f"define void @{NAME}({', '.join(ARGUMENTS)}) {{"]
    if not flush:
        return [*lines, f"  call void @{BODY}({passed})", "  ret void", "}"]
    return [
        "declare void @llvm.x86.sse.stmxcsr(ptr)",
        "declare void @llvm.x86.sse.ldmxcsr(ptr)",
        *lines,
        "  %before = alloca i32",
        "  %during = alloca i32",
        "  call void @llvm.x86.sse.stmxcsr(ptr %before)",
        "  %word = load i32, ptr %before",
        f"  %changed = or i32 %word, {FLUSH}",
        "  store i32 %changed, ptr %during",
        "  call void @llvm.x86.sse.ldmxcsr(ptr %during)",
        f"  call void @{BODY}({passed})",
        "  call void @llvm.x86.sse.ldmxcsr(ptr %before)",
        "  ret void",
        "}",
    ]


def _call() -> list[str]:
    """Assembly of a second entry function, whose only argument is a pointer to the
    array of all arguments.
    """
    # ctypes converts every argument of a call: one pointer takes least
    kinds = [argument.split()[0] for argument in ARGUMENTS]
    lines = [f"define void @{CALL}(ptr %arguments) {{"]
    for k, kind in enumerate(kinds):
        lines.append(f"  %at{k} = getelementptr i64, ptr %arguments, i64 {k}")
        lines.append(f"  %a{k} = load {kind}, ptr %at{k}, align 8")
    passed = ", ".join(f"{kind} %a{k}" for k, kind in enumerate(kinds))
    return [*lines, f"  call void @{NAME}({passed})", "  ret void", "}"]


def _split(
    nodes: tuple[Node, ...], parameters: tuple[Node, ...]
) -> tuple[list[Node], list[Node]]:
    """Split operations into those that depend on parameters and constants only, and all
    others.
    """
    fixed = {node.index for node in parameters}
    invariant, varying = [], []
    for node in nodes:
        if node.op == "input":
            continue
        # a loop variable has no operands and yet varies
        if node.op == "const" or (
            node.op != "slot" and all(arg.index in fixed for arg in node.args)
        ):
            fixed.add(node.index)
            invariant.append(node)
        else:
            varying.append(node)
    return invariant, varying


def split_by_row(loop: Loop) -> tuple[Loop, Loop]:
    """Take what depends on a step's row of inputs alone out of the step, which then
    reads it from a longer row.

    Bits stay, also where a product and its only sum are rounded once, as they stay
    together.

    Returns:
        Program whose carry is the row and whose log are the numbers that follow it; the
        step.
    """
    nodes = loop.program.nodes
    inputs = loop.program.inputs
    outputs = loop.program.outputs
    end = loop.carry + loop.parameters + loop.row
    row = inputs[end - loop.row : end]
    known, rest = _split(nodes, row)
    uses = Counter(
        node.index for node in (*outputs, *(arg for each in nodes for arg in each.args))
    )
    read, added = (
        {
            node.index
            for node in (*outputs, *(arg for each in rest for arg in each.args))
        },
        list[Node](),
    )
    for node in reversed(known):
        if node.index not in read:
            continue
        # a condition is no number; a product with one use may be rounded with that
        if (
            node.op == "const"
            or is_condition(node)
            or (node.op == "mul" and uses[node.index] == 1)
        ):
            rest.append(node)
            read.update(arg.index for arg in node.args)
        else:
            added.append(node)
    rest.sort(key=lambda node: node.index)
    ahead = Loop(
        Lowered(row, tuple(known), (*row, *added)), loop.row, 0, 0, (), len(added), ()
    )
    program = Lowered((*inputs[:end], *added, *inputs[end:]), tuple(rest), outputs)
    return ahead, replace(loop, program=program, row=loop.row + len(added))


def _addresses(writer: Writer, base: str, first: str, count: int) -> Iterator[str]:
    """Write assembly for the addresses of variables in turn, from the offset ``first``
    on; yields their names.

    Each is a step of ``%lanes`` from the last: a multiplication for every one was a
    quarter of a program's text.
    """
    at = base
    skip = first
    for _ in range(count):
        at = writer.emit(f"getelementptr {writer.lanes.scalar}, ptr {at}, i64 {skip}")
        skip = "%lanes"
        yield at


def _load(writer: Writer, base: str, count: int) -> list[str]:
    """Write assembly that reads variables of the current block of SIMD lanes; returns
    their names.
    """
    lanes = writer.lanes
    places = _addresses(writer, base, "%offset", count)
    return [
        writer.emit(f"load {lanes.vector}, ptr {at}, align {lanes.bytes}")
        for at in places
    ]


def _store(writer: Writer, base: str, first: str, names: Sequence[str]) -> None:
    """Write assembly that stores variables of the current block of SIMD lanes."""
    lanes = writer.lanes
    for at, name in zip(
        _addresses(writer, base, first, len(names)), names, strict=True
    ):
        writer.do(f"  store {lanes.vector} {name}, ptr {at}, align {lanes.bytes}")


def _row(writer: Writer, index: int) -> str:
    """Write assembly that copies one shared input of a step into all SIMD lanes;
    returns the vector's name.
    """
    lanes = writer.lanes
    at = writer.emit(f"getelementptr {lanes.scalar}, ptr %row, i64 {index}")
    return writer.broadcast(
        writer.emit(f"load {lanes.scalar}, ptr {at}, align {lanes.bytes}"), lanes.scalar
    )


def _write_log(writer: Writer, names: list[str]) -> None:
    """Write assembly that stores the logged outputs every ``%every`` steps: log[step /
    every][output][lane].
    """
    writer.do(f"""
  %log.rest = urem i64 %i, %every
  %log.due = icmp eq i64 %log.rest, 0
  br i1 %log.due, label %write, label %written
write:
  %log.entry = udiv i64 %i, %every
  %log.line = mul i64 %log.entry, {len(names)}
  %log.skip = mul i64 %log.line, %lanes
  %log.first = add i64 %log.skip, %offset""")
    _store(writer, "%log", "%log.first", names)
    writer.do("  br label %written\nwritten:")
