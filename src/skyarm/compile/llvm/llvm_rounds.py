"""LLVM assembly of the two functions through which threads share the lanes of a stepped program.

    void step_lead(control*)    by the thread that wants the result
    void step_help(control*)    by any number of others

Groups of lanes are taken one after the other and stepped a slice at a time: the blocks of one group, ``span`` steps.
A round lasts from the call of ``step_lead`` to its return: it opens the control, works itself, closes it when nothing
is left of the lanes or of the round's slices, and returns when every helper is idle. Who comes before or after a round
leaves at once. So no thread is ever inside the arrays while the caller of ``step_lead`` is outside of it, whatever
happens to the caller there.
"""

from __future__ import annotations

LEAD, HELP = "step_lead", "step_help"

PLACES = {
    name: 8 * place + 64 * line
    for line, names in enumerate(
        (
            # read by all: the five arrays, then what step_loop is told
            ("carry", "parameters", "rows", "log", "keys", "start", "lanes", "every"),
            ("steps", "blocks", "group", "groups", "span", "reached", "most", "pause"),
            # written by all, each in a line of its own
            ("state",),
            ("active",),
            ("next",),
            ("left",),
        )
    )
    for place, name in enumerate(names)
}
"""Byte of each number of a control; all are 64-bit.

``reached``: address of the step that each group has come to. ``most``: helpers at a time. ``pause``: address of a
function without arguments that lets other threads run, or 0. ``next``: group to take. ``left``: slices of this round.
"""

SIZE = 64 * 6
"""Bytes of a control."""

WAITING, OPEN, CLOSED = 0, 1, 2
"""``state``: a round is about to begin; is on; is over."""

PATIENCE = 10_000
"""Looks at a number that another thread is about to change, before the processor is left to it: some microseconds."""

LOYALTY = 50
"""How often a helper leaves the processor to others before it gives up a round that does not begin."""


def rounds(name: str) -> list[str]:
    """Lines of both functions; ``name`` is the function that steps blocks."""
    return [*_work(name), *_wait(), *_lead(), *_help()]


def _place(name: str) -> str:
    """A name for the address of one of the control's numbers, by the lines of ``_places``."""
    return f"%at.{name}"


def _places(*names: str) -> list[str]:
    return [f"  {_place(name)} = getelementptr i8, ptr %control, i64 {PLACES[name]}" for name in names]


def _loads(kinds: dict[str, str]) -> list[str]:
    lines = _places(*kinds)
    return lines + [f"  %{name} = load {kind}, ptr {_place(name)}, align 8" for name, kind in kinds.items()]


def _work(name: str) -> list[str]:
    """Take groups and step them until there is none, or no slice is left."""
    arrays = dict.fromkeys(("carry", "parameters", "rows", "log", "keys", "reached"), "ptr")
    numbers = dict.fromkeys(("start", "lanes", "every", "steps", "blocks", "group", "groups", "span"), "i64")
    return [
        "define internal void @step_work(ptr %control) noinline {",
        "entry:",
        *_loads(arrays | numbers),
        *_places("next", "left"),
        "  br label %take",
        "take:",
        f"  %mine = atomicrmw add ptr {_place('next')}, i64 1 monotonic",
        "  %any = icmp slt i64 %mine, %groups",
        "  br i1 %any, label %taken, label %done",
        "taken:",
        "  %first = mul i64 %mine, %group",
        "  %beyond = add i64 %first, %group",
        "  %whole = icmp slt i64 %beyond, %blocks",
        "  %last = select i1 %whole, i64 %beyond, i64 %blocks",
        "  %at.mine = getelementptr i64, ptr %reached, i64 %mine",
        "  %before = load i64, ptr %at.mine, align 8",
        "  br label %slice",
        "slice:",
        "  %begin = phi i64 [ %before, %taken ], [ %end, %step ]",
        "  %more = icmp slt i64 %begin, %steps",
        "  br i1 %more, label %spend, label %take",
        "spend:",
        f"  %spent = atomicrmw sub ptr {_place('left')}, i64 1 monotonic",
        "  %allowed = icmp sgt i64 %spent, 0",
        "  br i1 %allowed, label %step, label %done",
        "step:",
        "  %on = add i64 %begin, %span",
        "  %short = icmp slt i64 %on, %steps",
        "  %end = select i1 %short, i64 %on, i64 %steps",
        f"  call void @{name}(ptr %carry, ptr %parameters, ptr %rows, ptr %log, ptr %keys, i64 %first, i64 %last,"
        " i64 %begin, i64 %end, i64 %start, i64 %lanes, i64 %every)",
        "  store i64 %end, ptr %at.mine, align 8",
        "  br label %slice",
        "done:",
        "  ret void",
        "}",
    ]


def _wait() -> list[str]:
    """Wait while a number has a value, at most ``%times`` turns of the other threads; True when it has changed."""
    return [
        "define internal i1 @step_wait(ptr %control, ptr %number, i64 %value, i64 %times) noinline {",
        "entry:",
        *_loads({"pause": "ptr"}),
        "  %none = icmp eq ptr %pause, null",
        "  br label %look",
        "look:",
        "  %looks = phi i64 [ 0, %entry ], [ %looked, %same ], [ 0, %yielded ]",
        "  %turns = phi i64 [ 0, %entry ], [ %turns, %same ], [ %turned, %yielded ]",
        "  %now = load atomic i64, ptr %number seq_cst, align 8",
        "  %still = icmp eq i64 %now, %value",
        "  br i1 %still, label %stay, label %changed",
        "stay:",
        "  %looked = add i64 %looks, 1",
        f"  %patient = icmp slt i64 %looked, {PATIENCE}",
        "  br i1 %patient, label %same, label %yield",
        "same:",
        "  br label %look",
        "yield:",
        "  %turned = add i64 %turns, 1",
        "  %loyal = icmp sle i64 %turned, %times",
        "  br i1 %loyal, label %leave, label %given",
        "leave:",
        "  br i1 %none, label %yielded, label %rest",
        "rest:",
        "  %ignored = call i32 %pause()",
        "  br label %yielded",
        "yielded:",
        "  br label %look",
        "changed:",
        "  ret i1 true",
        "given:",
        "  ret i1 false",
        "}",
    ]


def _lead() -> list[str]:
    return [
        f"define void @{LEAD}(ptr %control) {{",
        "entry:",
        *_places("state", "active"),
        f"  store atomic i64 {OPEN}, ptr {_place('state')} seq_cst, align 8",
        "  call void @step_work(ptr %control)",
        f"  store atomic i64 {CLOSED}, ptr {_place('state')} seq_cst, align 8",
        "  br label %look",
        "look:",
        # a helper says first that it is there and looks then whether it may be: one of the two sees the other
        f"  %there = load atomic i64, ptr {_place('active')} seq_cst, align 8",
        "  %alone = icmp eq i64 %there, 0",
        "  br i1 %alone, label %done, label %wait",
        "wait:",
        f"  %changed = call i1 @step_wait(ptr %control, ptr {_place('active')}, i64 %there, i64 {2**62})",
        "  br label %look",
        "done:",
        "  ret void",
        "}",
    ]


def _help() -> list[str]:
    return [
        f"define void @{HELP}(ptr %control) {{",
        "entry:",
        *_loads({"most": "i64"}),
        *_places("state", "active"),
        f"  %begun = call i1 @step_wait(ptr %control, ptr {_place('state')}, i64 {WAITING}, i64 {LOYALTY})",
        f"  %others = atomicrmw add ptr {_place('active')}, i64 1 seq_cst",
        f"  %state = load atomic i64, ptr {_place('state')} seq_cst, align 8",
        f"  %open = icmp eq i64 %state, {OPEN}",
        "  %room = icmp slt i64 %others, %most",
        "  %welcome = and i1 %open, %room",
        "  br i1 %welcome, label %work, label %done",
        "work:",
        "  call void @step_work(ptr %control)",
        "  br label %done",
        "done:",
        f"  %left = atomicrmw sub ptr {_place('active')}, i64 1 seq_cst",
        "  ret void",
        "}",
    ]
