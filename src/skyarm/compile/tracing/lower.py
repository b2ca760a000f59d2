"""Lowering of sin, exp and other functions to basic operations, so that all simulators
compute the same bits.

A repetition is a loop in machine code, written out on every engine that has no loops.
It keeps long programs short: twenty integration steps of a stiff joint cost the code of
one. Its body may use any value from outside; what does not change inside is computed
once. Loops do not nest: a repetition inside one is written out.

A function that many records of one structure pass through, such as the law of several
vehicles, is shared: its machine code is written once and called, so that equal vehicles
compile in less time and stay in the processor's cache.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Sequence
from typing import TypeVar, cast

from skyarm.algebra import Scalar
from skyarm.algebra.scalars import where
from skyarm.algebra.scalars.elementary import COMPOSED
from skyarm.compile.tracing.tracer import Graph, Lowered, Node, is_condition
from skyarm.records.leaves import blend, leaves, mismatch, rebuild


def lower(
    inputs: Sequence[Node], nodes: Sequence[Node], outputs: Sequence[Node]
) -> Lowered:
    """Rewrite a traced program in basic operations such as + and *."""
    target = Graph(loops=True)
    made = {node.index: target.input(node.value) for node in inputs}

    def lower_node(node: Node, args: list[Node]) -> Node:
        if node.op == "const":
            return target.constant(node.value)
        if node.op in COMPOSED:
            return target.lift(COMPOSED[node.op](*args))
        if node.op in ("add", "sub", "mul", "neg"):
            return cast("Node", getattr(target, node.op)(*args))
        if node.op == "slot":
            return target.slot()
        if node.op == "repeat":
            count, slots, until = node.value
            half = len(slots)
            variables = [
                made[slot.index] if slot.index in made else target.slot()
                for slot in slots
            ]
            items = target.repeat(
                count, variables, args[:half], args[half:], until=until
            )
            return items[0].args[0]
        if node.op == "item":
            return target.item(args[0], node.value)
        if node.op == "call":
            function, sizes = node.value
            given = iter(args)
            groups = [[next(given) for _ in range(size)] for size in sizes]
            # a call without results is not live: the first of them leads to its node
            return target.external(function, groups, 1)[0].args[0]
        if node.op == "apply":
            return target.apply(node.value, args)
        if node.op == "result":
            return target.result(args[0], node.value)
        return target.call(node.op, *args)

    for node in nodes:
        if node.op != "input":
            args = [made[arg.index] for arg in node.args]
            made[node.index] = lower_node(node, args)
    results = tuple(made[node.index] for node in outputs)
    target.close()
    return Lowered(
        tuple(made[node.index] for node in inputs), tuple(live(results)), results
    )


def live(outputs: Sequence[Node]) -> list[Node]:
    """List the operations that the outputs of a program depend on, in order of
    creation.
    """
    # a list in place of recursion: programs are deeper than Python allows
    seen: dict[int, Node] = {}
    stack = list(outputs)
    while stack:
        node = stack.pop()
        if node.index not in seen:
            seen[node.index] = node
            stack.extend(node.args)
    return [seen[index] for index in sorted(seen)]


Record = TypeVar("Record")

WRITTEN_OUT = 6000
"""Number of operations up to which a repeated block is unrolled, which runs a fifth
faster but compiles longer."""


def repeat_while(
    count: int, rounds: Scalar, function: Callable[[Record], Record], record: Record
) -> Record:
    """Apply ``function`` ``rounds`` times, at most ``count``; ``rounds`` may be
    symbolic and differ between SIMD lanes.

    Machine code makes as many rounds as the lane that asks for most, none where none
    asks; other lanes keep what they have. Where nothing can be skipped, ``count``
    rounds are made.

    Args:
        count: most rounds.
        rounds: number of rounds, at least 0.
        function: one round.
        record: record before the first round.
    """

    def round_of(both: tuple[Scalar, Record]) -> tuple[Scalar, Record]:
        # rounds are whole numbers held as floats, so half of one tells 1 from 0
        left, now = both
        return left - 1.0, blend(left > 0.5, function(now), now)

    return repeat(count, round_of, (rounds, record), until=0)[1]


Made = TypeVar("Made")


def compute_where(
    condition: Scalar, function: Callable[[Record], Made], record: Record, other: Made
) -> Made:
    """Function of a record where a condition holds, else ``other``, a record of as many
    scalars.

    Machine code computes the function only if the condition holds in one of its lanes.

    Args:
        condition: bool, or a symbolic one.
        function: pure function of the record; what does not depend on the record is
            computed in any case.
        record: nested dataclass of scalars.
        other: result where the condition does not hold.
    """
    if isinstance(condition, bool):
        return function(record) if condition else other
    return repeat_while(
        1,
        where(condition, 1.0, 0.0),
        # the record goes round with the result: what does not would leave the loop
        lambda both: (both[0], function(both[0])),
        (record, other),
    )[1]


def repeat(
    count: int,
    function: Callable[[Record], Record],
    record: Record,
    until: int | None = None,
) -> Record:
    """Apply ``function`` ``count`` times in succession, starting from the nested
    dataclass ``record``.

    It is a loop in a traced program that may have loops; ``until`` as of
    :meth:`Graph.repeat`.

    Raises:
        ValueError: the function returns a record with another number of scalars.
    """
    graph = next(
        (leaf.graph for leaf in leaves(record) if isinstance(leaf, Node)), None
    )
    if graph is not None and graph.loops and (count > 1 or until is not None):
        graph.loops = False
        try:
            # traced once as a loop, which tells how many operations it has
            starts = [graph.lift(leaf) for leaf in leaves(record)]
            before = len(graph.nodes)
            slots = [graph.slot() for _ in starts]
            ends = [
                graph.lift(leaf) for leaf in leaves(function(rebuild(record, slots)))
            ]
            if len(ends) != len(starts):
                raise ValueError(
                    f"the function returns a record of {len(ends)} scalars, took one of"
                    f" {len(starts)}"
                )
            if until is not None or count * (len(graph.nodes) - before) > WRITTEN_OUT:
                return rebuild(
                    record, graph.repeat(count, slots, starts, ends, until=until)
                )
            for _ in range(count):
                record = function(record)
            return record
        finally:
            graph.loops = True
    for _ in range(count):
        record = function(record)
    return record


Result = TypeVar("Result")


def compiled_once(
    key: Hashable,
    function: Callable[[Record], Result],
    record: Record,
    constants: object = (),
    *,
    any_numbers: bool = False,
    only: tuple[Scalar, Result] | None = None,
) -> Result:
    """Apply a function to a record; in a program for machine code, by code that is
    written once for all equal calls.

    Calls are equal if key and constants are, and the structure and the constants of the
    record. Bits are those of ``function(record)``.

    Args:
        key: what the function depends on besides the record, as far as it has a hash.
        function: pure function of the record, without calls of Python functions that
            cannot be traced.
        record: nested dataclass of scalars.
        constants: what else the function depends on; where it has a symbolic value,
            each call has code of its own.
        any_numbers: calls are equal whatever the floats of the record are; without,
            these are constants of the code.
        only: a condition, and the result where it does not hold: machine code calls the
            function only if the condition holds in one of its lanes, within loops, too.
    """
    if only is not None and isinstance(only[0], bool):
        if not only[0]:
            return only[1]
        only = None
    symbols = _symbols(record)
    if any_numbers and symbols:
        lift = symbols[0].graph.lift
        record = rebuild(
            record,
            (lift(x) if type(x) is float else x for x in leaves(record)),
        )
        symbols = _symbols(record)
    whole = (record, constants)
    functions = symbols[0].graph.functions if symbols else None
    if functions is None or _symbols(constants):
        return _only(only, function(record))
    known = functions.setdefault(key, [])
    call = next((each for each in known if _equal_call(each[0], whole)), None)
    if call is None:
        inner = Graph(loops=True)
        # what a function calls is written once for all that call it
        inner.functions = functions
        inputs = [inner.input(f"x{i}") for i, _ in enumerate(symbols)]
        result = function(_with_symbols(record, inputs))
        result = _with_symbols(
            result,
            [each.value if each.op == "const" else each for each in _symbols(result)],
        )
        # refuses a symbol that is no input
        outputs = [inner.lift(each) for each in _symbols(result)]
        if any(map(is_condition, (*symbols, *outputs))):
            return _only(only, function(record))
        call = whole, lower(inputs, live(outputs), outputs), result
        # closing a graph clears its functions, which others share here
        inner.functions = None
        inner.close(lowered=True)
        known.append(call)
    graph, (_, lowered, shape) = symbols[0].graph, call
    result = cast("Result", shape)
    if only is None:
        block = graph.apply(lowered, symbols)
    else:
        rows = zip(leaves(result), leaves(only[1]), strict=True)
        others = [graph.lift(old) for new, old in rows if isinstance(new, Node)]
        block = graph.apply(lowered, [*symbols, graph.lift(only[0]), *others])
    results = [graph.result(block, k) for k in range(len(lowered.outputs))]
    return _only(only, _with_symbols(result, results), called=True)


def _only(
    only: tuple[Scalar, Result] | None, result: Result, *, called: bool = False
) -> Result:
    """Result where a condition holds, if there is one, else another.

    The symbols of a call are chosen already.
    """
    if only is None:
        return result
    return rebuild(
        only[1],
        (
            new if called and isinstance(new, Node) else where(only[0], new, old)
            for new, old in zip(leaves(result), leaves(only[1]), strict=True)
        ),
    )


def _symbols(record: object) -> list[Node]:
    """Symbolic values among the leaves of a nested dataclass."""
    return [leaf for leaf in leaves(record) if isinstance(leaf, Node)]


def _with_symbols(record: Record, values: Sequence[Scalar]) -> Record:
    """Copy of a nested dataclass with its symbolic values replaced, in order."""
    given = iter(values)
    return rebuild(
        record,
        (next(given) if isinstance(leaf, Node) else leaf for leaf in leaves(record)),
    )


def _equal_call(example: tuple[object, object], whole: tuple[object, object]) -> bool:
    """True if a call's record and constants are those of an example but for symbolic
    values.
    """
    return all(
        a is b
        or (mismatch(a, b, "") is None and all(map(_alike, leaves(a), leaves(b))))
        for a, b in zip(example, whole, strict=True)
    )


def _alike(one: object, other: object) -> bool:
    """True if two leaves are symbolic values both, or the same number to the sign of a
    zero, or one object.
    """
    if type(one) is not type(other):
        return False
    # by the text of floats: 0.0 is not -0.0, and NaN is NaN
    return (
        one is other
        or isinstance(one, Node)
        or (type(one) is float and repr(one) == repr(other))
    )


def arrange(nodes: Iterable[Node]) -> list[tuple[Node, list[Node]]]:
    """Order the operations of a program for evaluation, each with its loop body (empty
    for all but loops).
    """
    arranged: list[tuple[Node, list[Node]]] = []
    inside: dict[int, int] = {}
    bodies: dict[int, list[Node]] = {}
    for node in nodes:
        if not inside and node.op not in ("slot", "repeat"):
            arranged.append((node, []))
        elif node.op == "slot":
            inside[node.index] = node.value
            bodies.setdefault(node.value, [])
        elif node.op == "repeat":
            loop = node.value[1][0].value
            arranged.append((node, bodies.pop(loop, [])))
        else:
            # what depends on a variable of a loop is inside it
            for arg in node.args:
                if arg.index in inside:
                    loop = inside[node.index] = inside[arg.index]
                    bodies[loop].append(node)
                    break
            else:
                arranged.append((node, []))
    return arranged


EARLY = 4
"""Rounds that are counted of a loop which may end early, as that of the substeps in
contact: its most are hundreds, 288 for grasps. Counted by its most, 16 of 26 shipped
scenarios looked too large to be optimised."""


def operations(
    nodes: Iterable[Node],
    *,
    written: bool = False,
    known: dict[int, int] | None = None,
) -> int:
    """Count the operations that one evaluation of a program executes.

    Args:
        nodes: operations of the program.
        written: count what is compiled: code once, however often it is called or
            repeated.
        known: operations of functions that are counted already, by their identity.
    """
    quiet = ("input", "const", "item", "result")
    sizes = {} if known is None else known
    count = 0

    def of(block: Node) -> int:
        """Number of operations of a call beyond the one that it is."""
        if id(block.value) not in sizes:
            sizes[id(block.value)] = 0
            sizes[id(block.value)] = operations(
                block.value.nodes, written=written, known=sizes
            )
        return -1 if written else sizes[id(block.value)] - 1

    for node, body in arrange(nodes):
        if node.op == "repeat":
            most, _, until = node.value
            rounds = 1 if written else most if until is None else min(most, EARLY)
            count += (
                len(body) + sum(of(each) for each in body if each.op == "apply")
            ) * rounds
        elif node.op not in quiet:
            count += of(node) + 1 if node.op == "apply" else 1
    # what functions call is among them, so only the whole program adds them up
    return count + (sum(sizes.values()) if written and known is None else 0)
