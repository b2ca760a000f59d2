"""Tables of the reference pages, generated from records, registries and signatures.

A page holds ``<!-- generated: KIND WORDS -->``, the table, ``<!-- /generated -->``.
``--write`` fills every block of docs/*.md, or of the pages that are named;
:func:`stale_blocks` finds those that differ from the program.
"""

from __future__ import annotations

import dataclasses
import inspect
import math
import re
import sys
import textwrap
import tomllib
from collections.abc import Callable, Iterable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import typer
import yaml

# the tests' own modules, when this is run as a program
sys.path.append(str(Path(__file__).resolve().parents[1]))

import skyarm
from skyarm.algebra import Quaternion, Vec3
from skyarm.cli.arguments import EVERY
from skyarm.cli.commands import program
from skyarm.control.catalogue import (
    AUTOPILOTS,
    LAWS,
    PRESETS,
    make_controller,
    tuned_factors,
)
from skyarm.control.law_maker import default_gains
from skyarm.control.laws.predictive.cost import Weights
from skyarm.control.laws.predictive.observer import Bandwidths
from skyarm.control.model import (
    TORQUE_GAINS,
    GeometricGains,
    JointGains,
    Model,
    Terms,
)
from skyarm.control.option_units import OptionText, option_texts
from skyarm.log.metrics.accumulate import CONTINUOUS
from skyarm.log.metrics.metric_catalogue import (
    FREE,
    GRASPS,
    GROUPS,
    GUST,
    INTERACTION,
    PAPER,
    TEAMS,
    TRACKING,
    measures,
)
from skyarm.records.field_rules import defaults
from skyarm.records.immutable import stated_fields
from skyarm.records.registry import find, names
from skyarm.records.registry.registrations import registrations
from skyarm.records.registry.shipped import SECTIONS
from skyarm.records.units import Unit, declared_fields, units
from skyarm.records.words import words_of_fields
from skyarm.scenario import word_texts
from skyarm.scenario.controller_table import law_words, option_words
from skyarm.scenario.grammar import (
    SIGNAL,
    GrammarRow,
    default_in_words,
    entry_in_words,
    grammar,
)
from skyarm.sensing.cameras.camera_kinds import RaySensor
from skyarm.sensing.channel import Channel, ChannelSensor
from skyarm.vehicle.attach import Mimic
from skyarm.vehicle.linkage import Body, Joint
from skyarm.vehicle.tilt import Tilt
from skyarm.vehicle.vehicle_records import BodyDrag, Rotor
from support.check_list import CHECKS
from website.listed_parts import (
    arrays_of_log,
    flown_trials,
    menu_lines,
    parts_of_environments,
    trials_of_suite,
)
from website.python_names import (
    arguments_of,
    classes_of,
    first_line,
    functions_of,
    modules_of,
)

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
DOCUMENTS = tomllib.loads(
    Path(__file__).with_name("document_keys.toml").read_text("utf-8")
)
EQUATIONS = tomllib.loads(Path(__file__).with_name("equations.toml").read_text("utf-8"))
BLOCK = re.compile(
    r"^<!-- generated: ([^\n]*?) -->\n(.*?)^<!-- /generated -->$", re.M | re.S
)

Rows = Iterable[Sequence[str]]


def table(heads: Sequence[str], rows: Rows) -> str:
    """Markdown table without the columns in which no row has anything."""
    cells = [[cell.replace("|", "\\|").strip() for cell in row] for row in rows]
    kept = [
        i
        for i in range(len(heads))
        if i == 0 or any(row[i] not in ("", "-") for row in cells)
    ]
    lines = ["| " + " | ".join(heads[i] for i in kept) + " |", "|" + "-|" * len(kept)]
    lines += ["| " + " | ".join(row[i] or "-" for i in kept) + " |" for row in cells]
    return "\n".join(lines) + "\n"


OPTION_HEADS = ("option", "type and unit", "default", "allowed", "meaning", "effect")


def shown(value: object) -> str:
    """Default value as a file writes it."""
    if value is None or value == () or (isinstance(value, str) and not value):
        return "none"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, str):
        return f'`"{value}"`'
    if isinstance(value, float | int):
        return "no limit" if math.isinf(value) else f"`{value:.10g}`"
    if isinstance(value, tuple | list | Vec3 | Quaternion):
        return "`[" + ", ".join(f"{float(each):.10g}" for each in value) + "]`"
    if value == Terms():
        return "none"
    return "" if dataclasses.is_dataclass(value) else f"`{value}`"


def bounds(unit: Unit) -> str:
    """Allowed numbers in words; empty if any number is allowed."""
    low, high = unit.low, unit.high
    if math.isfinite(low) and math.isfinite(high):
        return (
            f"above {low:g}, below {high:g}" if unit.strict else f"{low:g} to {high:g}"
        )
    if math.isfinite(low):
        return f"above {low:g}" if unit.strict else f"at least {low:g}"
    if math.isfinite(high):
        return f"below {high:g}" if unit.strict else f"at most {high:g}"
    return ""


def typed(entry: str, unit: str) -> str:
    """Type and unit as one cell."""
    return ", ".join(filter(None, (entry, unit)))


TABLES: dict[str, type] = {
    "gains": GeometricGains,
    "joint_gains": JointGains,
    "weights": Weights,
    "bandwidths": Bandwidths,
}
"""Options of laws that are tables of a record's fields."""

ON_TORQUE = ("decoupled_pd", "admittance_pd")
"""Laws whose joint gains act on torque."""


def law_block(law: str, *left_out: str) -> str:
    """Options of a law or of an autopilot, in the order of its maker; ``-NAME`` leaves
    out the fields of a table.
    """
    assert law in (*LAWS, *AUTOPILOTS), f"no law {law}"
    rows: list[Sequence[str]] = []
    texts = option_texts(law)
    for word, option in option_words(law).items():
        text = texts[option]
        name, entry, *more = _option_row(word, text)
        if f"-{word}" in left_out:  # its fields stand once, for all cards
            rows.append((name, f"[{entry}](../laws.md#gains)", *more))
        else:
            rows += [(name, entry, *more), *_table_rows(word, law, text)]
    return table(OPTION_HEADS, rows)


def card_block(law: str) -> str:
    """What a law can do, of which a reader asks first."""
    model = Model(vehicle=skyarm.load_vehicle("hummingbird_arm2"))
    options, made_law = LAWS[law].options(), make_controller(law, model)
    # every law that commands joint torques flies servos through a layer
    assert "servos" in law_words(law)
    return table(
        ("joint servos", "contact force", "tilting rotors", "C file", "batches"),
        [
            (
                "yes",
                "commands it" if "interaction" in options else "no",
                "commands them" if "sideways" in options else "kept at rest",
                *(("yes" if made_law.compiled else "no",) * 2),
            )
        ],
    )


def gains_block(option: str, law: str) -> str:
    """Fields of an option that is a table, as a law has it: those that cards of several
    laws leave out.
    """
    rows = _table_rows(option, law, option_texts(law)[option])
    assert rows, f"{option} is no table"
    if TABLES[option] is GeometricGains:
        rows = [(*row[:2], _scaled_gain(row[0].strip("`")), *row[3:]) for row in rows]
    return table(OPTION_HEADS, rows)


def _scaled_gain(name: str) -> str:
    """Default of a gain of the base in words, and that of the paper's vehicle."""
    field = name.rpartition(".")[2]
    model = Model(vehicle=skyarm.load_vehicle("hummingbird_arm2"))
    J, mass = model.vehicle.base.inertia, model.vehicle.mass
    gain = getattr(default_gains(model), field)
    linear = field in ("position", "velocity")
    over = (mass,) * 3 if linear else (J.xx, J.yy, J.zz)
    x, y, z = (f"{float(g) / float(by):.4g}" for g, by in zip(gain, over, strict=True))
    assert x == y
    words = (
        f"{x} times the mass (kg)"
        if linear
        else f"{x} times the inertia (kg m^2), about z {z} times"
    )
    return f"{words}; paper: {shown(Vec3(*(round(float(g), 3) for g in gain)))}"


def _option_row(word: str, text: OptionText) -> Sequence[str]:
    allowed = (
        text.allowed
        if "`" in text.allowed
        else re.sub(r'("[^"]*")', r"`\1`", text.allowed)
    )
    default = text.usual or shown(text.default)
    return (
        f"`{word}`",
        typed(text.entry, text.unit.unit),
        default,
        allowed
        or bounds(text.unit)
        or ("true or false" if text.entry == "true or false" else ""),
        text.unit.meaning,
        text.effect or text.unit.effect,
    )


def _table_rows(option: str, law: str, text: OptionText) -> list[Sequence[str]]:
    """Rows of the fields of an option that is a table."""
    if option not in TABLES:
        return []
    kind, rows = TABLES[option], list[Sequence[str]]()
    torque = TORQUE_GAINS if option == "joint_gains" and law in ON_TORQUE else {}
    for name, unit in units(kind).items():
        own = torque.get(name, unit)
        entry = (
            "three numbers" if kind is GeometricGains else "one number for each joint"
        )
        entry = entry if option in ("gains", "joint_gains") else "number"
        default = getattr(text.default, name, None)
        rows.append(
            (
                f"`{option}.{name}`",
                typed(entry, own.unit),
                "" if default is None else shown(default),
                bounds(unit),
                own.meaning,
                unit.effect,
            )
        )
    return rows


FIELD_HEADS = ("field", "type and unit", "default", "allowed", "meaning", "effect")


def coded(text: str, *, whole: bool = False) -> str:
    """Text with values of a file in code: quoted words, numbers and lists; the whole of
    a single one.
    """
    if "`" in text:
        return text
    if whole and re.fullmatch(r"-?[\d.]+(e[-+]?\d+)?|true|false|\[[^\]]*\]", text):
        return f"`{text}`"
    return re.sub(r'("[^"]*")', r"`\1`", text)


def either(entry: str) -> str:
    """Type in words, with a choice of texts as such."""
    quoted = re.findall(r"'([^']*)'", entry)
    return (
        "text"
        if quoted
        and re.fullmatch(r"'[^']*'( or '[^']*')*( \(.* if left out\))?", entry)
        else entry
    )


def with_degrees(cell: str, unit: str) -> str:
    """Default with its degrees, where these are a round number and its radians are
    not.
    """
    found = re.fullmatch(r"`(\d\.\d{9,})`", cell)
    if not found or not unit.startswith("rad"):
        return cell
    degrees = math.degrees(float(found[1]))
    return (
        f"{cell} ({degrees:.0f} degrees)"
        if abs(degrees - round(degrees)) < 1e-9
        else cell
    )


def choices(entry: str) -> str:
    """Texts that an entry may be, if it is a choice of few."""
    quoted = re.findall(r"'([^']*)'", entry)
    return (
        ", ".join(f'`"{each}"`' for each in quoted)
        if either(entry) == "text" and len(quoted) <= 4
        else ""
    )


def required_first(rows: list[Sequence[str]]) -> list[Sequence[str]]:
    """Rows of required fields before the others, whose order is kept; rows of a table
    stay below it.
    """
    groups: list[list[Sequence[str]]] = []
    for row in rows:
        inside = groups and row[0].strip("`").startswith(
            groups[-1][0][0].strip("`") + "."
        )
        groups[-1].append(row) if inside else groups.append([row])
    groups.sort(key=lambda group: not group[0][2].startswith("required"))
    return [row for group in groups for row in group]


def field_row(kind: type, name: str, word: str = "") -> Sequence[str]:
    """Row of a field of a record."""
    annotation, unit = declared_fields(kind)[name]
    text = word_texts.of_field(tuple(each.__name__ for each in kind.__mro__), name)
    # a file names a vehicle
    entry = "text" if annotation is skyarm.Vehicle else entry_in_words(annotation)
    default = text.default or default_in_words(defaults(kind)[name])
    return (
        f"`{word or words_of_fields(kind).get(name, name)}`",
        typed(either(entry), unit.unit),
        with_degrees(coded(default, whole=True), unit.unit),
        coded(text.allowed) or choices(entry) or bounds(unit),
        text.meaning or unit.meaning,
        text.effect or unit.effect,
    )


def loaded(path: str) -> Any:
    """Object of a path such as skyarm.Joint or skyarm.vehicle.battery:Battery."""
    module, _, name = path.partition(":") if ":" in path else path.rpartition(".")
    return getattr(import_module(module), name)


def record_block(path: str, *more: str) -> str:
    """Fields of records, required ones first; ``-NAME`` leaves a field out, further
    paths add records.

    Of several records a column tells of which each field is.
    """
    kinds = [
        loaded(each)
        for each in (path, *(word for word in more if not word.startswith("-")))
    ]
    left_out = {word[1:] for word in more if word.startswith("-")}
    if len(kinds) == 1:
        rows = [
            field_row(kinds[0], name)
            for name in stated_fields(kinds[0])
            if name in declared_fields(kinds[0]) and name not in left_out
        ]
        return table(FIELD_HEADS, required_first(rows))
    listed: dict[str, tuple[list[str], Sequence[str]]] = {}
    for kind in kinds:
        for name in declared_fields(kind):
            if name in stated_fields(kind) and name not in left_out:
                listed.setdefault(name, ([], field_row(kind, name)))[0].append(
                    registered_name(kind)
                )
    every = len(kinds)
    cells = [
        (row[0], "all" if len(of) == every else ", ".join(of), *row[1:])
        for of, row in listed.values()
    ]
    cells.sort(key=lambda row: not row[3].startswith("required"))
    return table(("field", "of", *FIELD_HEADS[1:]), cells)


def registered_name(kind: type) -> str:
    """Name of a class in the registry, in code."""
    of = getattr(kind, "registered_as", "")
    return next(
        (f"`{name}`" for name in names(of) if find(of, name) is kind),
        f"`{kind.__name__}`",
    )


def grammar_row(row: GrammarRow, prefix: str) -> Sequence[str]:
    """Row of a key of a scenario file, named below a table."""
    text = word_texts.of_path(row.path) if not row.of else word_texts.WordText()
    name = (
        row.path.removeprefix(prefix)
        .removeprefix("[]")
        .removeprefix(".")
        .replace("[]", "")
    )
    # a star would be emphasis; it stands for a name
    name = name.replace("*", "NAME")
    allowed = (
        text.allowed
        or choices(row.entry)
        or re.sub("^at least (.*), at most ", r"\1 to ", row.bounds)
    )
    return (
        f"`{name}`",
        typed(
            either(row.entry)
            .replace("list of tables", "tables")
            .replace(SIGNAL, "signal"),
            row.unit,
        ).replace("list of signal,", "list of signals,"),
        with_degrees(coded(row.default, whole=True), row.unit),
        coded(allowed),
        row.meaning,
        row.effect,
    )


def words_block(prefix: str, *kinds: str) -> str:
    """Keys of a scenario file below a table, or of the top; of some kinds, one after
    the other with their name.

    ``-NAME`` leaves a key, and what is below it, out. ``+`` shows keys of tables
    inside, too. ``=A,B`` are the first.
    """
    left_out = [word[1:] for word in kinds if word.startswith("-")]
    chosen = [word for word in kinds if word[0] not in "-+="]
    order = [name for word in kinds if word[0] == "=" for name in word[1:].split(",")]
    rows = [
        row
        for row in grammar()
        if _is_below(row.path.replace("[]", ""), prefix, deep="+" in kinds)
    ]
    found: list[Sequence[str]] = []
    for row in rows:
        name = (
            row.path.replace("[]", "")
            .removeprefix(prefix)
            .removeprefix(".")
            .replace("*", "NAME")
        )
        if any(name == each or name.startswith(f"{each}.") for each in left_out):
            continue
        if row.of in chosen or (not row.of and not chosen):
            of = (f"`{row.of}`",) if len(chosen) > 1 else ()
            found.append((*of, *grammar_row(row, "" if prefix == "top" else prefix)))
    assert found, f"no keys below {prefix}"
    if len(chosen) > 1:
        return table(("kind", *FIELD_HEADS), found)
    found.sort(
        key=lambda row: (
            order.index(name) if (name := row[0].strip("`")) in order else len(order)
        )
    )
    return table(FIELD_HEADS, required_first(found))


def _is_below(path: str, prefix: str, *, deep: bool) -> bool:
    if prefix == "top":
        return "." not in path
    return path.startswith(f"{prefix}.") and (
        deep or path.count(".") == prefix.count(".") + 1
    )


def hand_rows(
    words: Iterable[word_texts.HandWord], *, kinds: bool
) -> list[Sequence[str]]:
    """Rows of keys that functions read."""
    return [
        (
            *((f"`{each.kind}`",) if kinds else ()),
            f"`{each.name}`",
            typed(each.entry, each.unit) if '"' not in each.entry else "text",
            coded(each.default or "required", whole=True),
            coded(each.allowed or (each.entry if '"' in each.entry else "")),
            each.meaning,
            "",
        )
        for each in words
    ]


def task_block(*kinds: str) -> str:
    """Keys of motions, studies or suites that functions read; of several kinds one
    after the other with their name.
    """
    chosen = [each for kind in kinds for each in word_texts.TASKS if each.kind == kind]
    assert {each.kind for each in chosen} == {*kinds}, f"no keys of {kinds}"
    rows = hand_rows(chosen, kinds=len(kinds) > 1)
    if len(kinds) > 1:
        return table(("kind", *FIELD_HEADS), rows)
    return table(FIELD_HEADS, required_first(rows))


def sensors_block() -> str:
    """Fields that a kind of sensor has beside those of every sensor, with its channels
    and their errors.
    """
    rows: list[Sequence[str]] = []
    shared = declared_fields(ChannelSensor)
    for name in names("sensor"):
        kind = find("sensor", name)
        if not issubclass(kind, ChannelSensor):
            continue
        usual = defaults(kind)
        for field, (annotation, _) in declared_fields(kind).items():
            if field in shared and usual[field] == defaults(ChannelSensor)[field]:
                continue
            row = field_row(kind, field)
            if annotation is Channel:
                row = _channel_row(row, usual[field])
            rows.append((f"`{name}`", *row))
    return table(("kind", *FIELD_HEADS), rows)


def cameras_block() -> str:
    """Fields that a camera or lidar has beside those of both."""
    rows: list[Sequence[str]] = []
    for name in names("sensor"):
        kind = find("sensor", name)
        if issubclass(kind, RaySensor):
            own = [*declared_fields(kind)][len(declared_fields(RaySensor)) :]
            rows += [(f"`{name}`", *field_row(kind, field)) for field in own]
    return table(("kind", *FIELD_HEADS), rows)


def _channel_row(row: Sequence[str], usual: Channel) -> Sequence[str]:
    """Row of a channel: its errors by default, where no text says them."""
    stated = [
        f"`{each}` {getattr(usual, each):g}"
        for each in declared_fields(Channel)
        if isinstance(getattr(usual, each), float) and getattr(usual, each)
    ]
    meaning = row[4] or "errors of this channel"
    told = row[2] if row[2] not in ("", "-", "none") else ""
    return (row[0], "errors", told or ", ".join(stated) or "none", "", meaning, "")


def phases_block() -> str:
    """Keys of the phases of a task, those of every phase first."""
    words = {"`every`": "every", "`contact`": "in contact"}
    rows = [
        (words.get(kinds, kinds.replace(", ", "`, `")), *cells)
        for kinds, *cells in hand_rows(word_texts.PHASES, kinds=True)
    ]
    return table(("phase", *FIELD_HEADS), rows)


def guard_block(part: str) -> str:
    """Keys of ``until`` of a phase: its conditions, or the others."""
    rows = hand_rows(
        (each for each in word_texts.GUARDS if each.kind == part), kinds=False
    )
    assert rows, f"no keys {part}"
    return table(FIELD_HEADS, rows)


def kinds_of_keys(kind: str, at: str) -> str:
    """Keys of all signals, or of the motions that are no tasks, one kind after the
    other.
    """
    rows = [
        row
        for row in grammar()
        if row.of and row.path.startswith(f"{at}.") and row.of in names(kind)
    ]
    assert rows
    return table(
        ("kind", *FIELD_HEADS),
        [(f"`{row.of}`", *_short_entry(grammar_row(row, at))) for row in rows],
    )


def _short_entry(cells: Sequence[str]) -> Sequence[str]:
    entry = re.sub(
        "number, list or table: a signal|list of signals?", "signal", cells[1]
    )
    quoted = '"' in entry
    return (
        cells[0],
        "text" if quoted else entry,
        cells[2],
        coded(entry) if quoted else cells[3],
        *cells[4:],
    )


VEHICLE_PARTS: dict[str, tuple[type, tuple[str, ...]]] = {
    "joint": (Joint, ("name", "axis", "position", "rotation")),
    "body": (Body, ("inertia",)),
    "rotors": (Rotor, ("name", "position", "direction")),
    "tilt": (Tilt, ()),
    "drag": (BodyDrag, ()),
    "mimic": (Mimic, ()),
}
"""Table of a vehicle file -> record, and fields that the file states otherwise."""


def vehicle_block(part: str) -> str:
    """Keys of a table of a vehicle file."""
    rows = hand_rows(
        (each for each in word_texts.VEHICLE if each.kind == part), kinds=False
    )
    kind, left_out = VEHICLE_PARTS.get(part, (None, ()))
    for name in declared_fields(kind) if kind else ():
        if kind is not None and name not in left_out:
            rows.append(field_row(kind, name, {"table": "thrust_table"}.get(name, "")))
    assert rows, f"no table {part}"
    return table(FIELD_HEADS, required_first(rows))


def imports_block(*forms: str) -> str:
    """What is read from files of other formats, form after form."""
    rows = [row for row in word_texts.IMPORTS if set(row[0].split(", ")) & {*forms}]
    assert rows, f"nothing is read from {forms}"
    several = len(forms) > 1
    return table(
        (*(("form",) if several else ()), "in the file", "read as", "gaps"),
        [row if several else row[1:] for row in rows],
    )


def kinds_block(kind: str) -> str:
    """Names of a kind of the registry that ship, each with its title."""
    return table(
        ("kind", "meaning"),
        [(f"`{name}`", row.title) for name, row in registrations(kind).items()],
    )


def presets_block() -> str:
    """Presets and the laws that they are of."""
    return table(
        ("preset", "law", "meaning"),
        [(f"`{n}`", f"`{p.law}`", p.title) for n, p in PRESETS.items()],
    )


def laws_block() -> str:
    """Laws with their titles, and whether tuned gains ship."""
    rows = [
        (f"`{name}`", "yes" if name in tuned_factors() else "no", each.title)
        for name, each in LAWS.items()
    ]
    return table(("law", "tuned gains", "meaning"), rows)


WINDOWED = {"whole": "the whole flight"}


def metrics_block(group: str) -> str:
    """Metrics of a group, with unit and window; ``groups`` lists the groups, ``others``
    what no group has.

    The pages say which groups have a ``_continuous`` version: all metrics of a group
    have one, or none has.
    """
    every = measures(1)
    if group == "groups":
        listed = [
            (f"`{name}`", ", ".join(f"`{each}`" for each in GROUPS[name]))
            for name in GROUPS
            if name != "all"
        ]
        return table(
            ("group", "metrics"),
            [*listed, ("`all`", "all below, without those of contact and of teams")],
        )
    twins = {name for name in every if name.endswith(CONTINUOUS)}
    chosen = {
        "tracking": (*TRACKING, *PAPER),
        "gust": tuple(GUST),
        "free": tuple(FREE),
        "contact": (*INTERACTION, *GRASPS),
        "teams": tuple(TEAMS),
        "registered": tuple(name for name in names("metric")),
    }[group]
    if 0 < sum(f"{name}{CONTINUOUS}" in twins for name in chosen) < len(chosen):
        raise ValueError(
            f"metrics {group}: some have a version with the suffix {CONTINUOUS}, some"
            " have none"
        )
    rows: list[Sequence[str]] = []
    for name in chosen:
        each = every[name]
        rows.append((f"`{name}`", each.unit, each.window, each.words))
    if group == "free":
        torque = every["tau1_rms"]
        rows.append(
            (
                "`tauN_rms`, `efforts` for all",
                torque.unit,
                torque.window,
                "RMS torque of joint N",
            )
        )
    return table(("metric", "unit", "window", "meaning"), rows)


def command_block(*words: str) -> str:
    """Arguments and options of a command, or of a command behind a word; those that
    every command has are left out.
    """
    every: Any = typer.main.get_command(program([words[0]]))
    command = every.commands[" ".join(words)]
    parts = (
        [
            each
            for name, each in every.commands.items()
            if name.startswith(f"{words[0]} ")
        ]
        if len(words) == 1
        else []
    )
    shared = [{each.name for each in part.params} for part in parts]
    rows: list[Sequence[str]] = []
    for each in command.params:
        has = [each.name in own for own in shared]
        older = any(has) and not all(has)
        if each.name in ("help", *EVERY) or each.hidden or older:
            continue
        is_option = each.param_type_name == "option"
        value = f"`{each.metavar}`" if each.metavar else ""
        name = (
            ", ".join(f"`{word}`" for word in each.opts)
            if is_option
            else f"`{each.metavar}`"
        )
        default = (
            ""
            if each.default in (None, False, ()) or callable(each.default)
            else f"`{each.default}`"
        )
        needed = "required" if each.required else default
        rows.append((name, value if is_option else "", needed, each.help or ""))
    return table(("argument or option", "value", "default", "meaning"), rows)


def commands_block() -> str:
    """All commands with the lines of their help, section by section."""
    rows = [
        (s, f"[`skyarm {name}`](#skyarm-{name})", t)
        for s, part in SECTIONS.items()
        for name, (_, t) in part.items()
    ]
    return table(("section", "command", "what it does"), rows)


def common_block() -> str:
    """Options that every command has."""
    every: Any = typer.main.get_command(program(["show"]))
    rows = [
        (
            ", ".join(f"`{word}`" for word in each.opts),
            f"`{each.metavar}`" if each.metavar else "",
            each.help,
        )
        for each in every.commands["show"].params
        if each.name in EVERY
    ]
    return table(("option", "value", "meaning"), rows)


def keys_block(command: str) -> str:
    """Keys of the JSON document of a command."""
    rows = [
        (
            f"`{name.rstrip('?')}`",
            "sometimes" if name.endswith("?") else "always",
            meaning,
        )
        for name, meaning in DOCUMENTS[command].items()
    ]
    return table(("key", "present", "meaning"), rows)


def methods_block(path: str) -> str:
    """Public methods and properties of a class of skyarm, with their signature and
    first line.
    """
    kind = loaded(path)
    rows: list[Sequence[str]] = []
    for name, each in inspect.getmembers(kind):
        home = next((base for base in kind.__mro__ if name in vars(base)), object)
        if name.startswith("_") or not home.__module__.startswith("skyarm"):
            continue
        held = vars(home)[name]
        if isinstance(held, property):
            rows.append((f"`{name}`", "property", first_line(held)))
        elif callable(each):
            given = [
                word
                for word in inspect.signature(each).parameters
                if word not in ("self", "cls")
            ]
            rows.append((f"`{name}({', '.join(given)})`", "method", first_line(each)))
    return table(("name", "is a", "meaning"), rows)


def python_block(kind: str, job: str = "") -> str:
    """Public names of skyarm of a job: functions, their arguments, classes; or
    modules.
    """
    made_by = {
        "functions": functions_of,
        "arguments": arguments_of,
        "classes": classes_of,
    }
    return table(*(made_by[kind](job) if job else modules_of()))


def checks_block(group: str) -> str:
    """Questions of ``skyarm check`` of a group; those that share all else are a row."""
    named: dict[tuple[str, ...], list[str]] = {}
    for each in CHECKS:
        if each.group == group:
            cells = (each.quantity, each.warning, each.fault, each.remedy)
            named.setdefault(cells, []).append(each.question)
    assert named, f"no checks of {group}"
    rows = [(", ".join(questions), *cells) for cells, questions in named.items()]
    heads = ("question", "quantity", "warning if", "fault if", "usual remedy")
    return table(heads, rows)


def glossary_block() -> str:
    """Links to all words of the glossary: headings, and words in italics below them."""
    place, words = "", dict[str, str]()
    for line in BLOCK.sub("", (DOCS / "glossary.md").read_text("utf-8")).splitlines():
        if line.startswith("### "):
            place = line[4:].lower().replace(" ", "-")
            words[line[4:].lower()] = place
        elif place:
            for word in re.findall(r"(?<!\*)\*([A-Za-z][a-z ]+)\*(?!\*)", line):
                words.setdefault(word.lower(), place)
    links = [f"[{word}](#{words[word]})" for word in sorted(words)]
    return textwrap.fill(" · ".join(links), 100, break_on_hyphens=False) + "\n"


def equations_block(group: str) -> str:
    """Equations with source and function; tests_of_equations.py has their tests."""
    rows = [
        (
            row["quantity"],
            f"$`{row['equation']}`$",
            row["source"],
            f"[`{Path(row['file']).stem}.{row['function']}`](../{row['file']})",
        )
        for row in EQUATIONS[group]
    ]
    return table(("quantity", "equation", "source", "function"), rows)


def menu_block() -> str:
    """Menu of the site as a list, for readers of the pages as they lie."""
    menu = yaml.safe_load((DOCS.parent / "mkdocs.yml").read_text("utf-8"))["nav"]
    return "\n".join(["", *menu_lines(menu[1:], "", DOCS), ""]) + "\n"


KINDS: dict[str, Callable[..., str]] = {
    "law": law_block,
    "card": card_block,
    "gains": gains_block,
    "laws": laws_block,
    "record": record_block,
    "words": words_block,
    "task": task_block,
    "sensors": sensors_block,
    "cameras": cameras_block,
    "parts": lambda of: table(*parts_of_environments(of)),
    "signals": lambda: kinds_of_keys("signal", "SIGNAL"),
    "motions": lambda: kinds_of_keys("motion", "reference.base"),
    "phases": phases_block,
    "guard": guard_block,
    "vehicle": vehicle_block,
    "imports": imports_block,
    "suite": lambda name: table(*trials_of_suite(name)),
    "kinds": kinds_block,
    "presets": presets_block,
    "metrics": metrics_block,
    "log": lambda part: table(*arrays_of_log(part)),
    "commands": commands_block,
    "common": common_block,
    "command": command_block,
    "keys": keys_block,
    "methods": methods_block,
    "python": python_block,
    "checks": checks_block,
    "glossary": glossary_block,
    "equations": equations_block,
    "menu": menu_block,
    "trials": lambda suite: table(*flown_trials(suite)),
}
"""Kind of a block -> function of its words that returns the table."""


def made(head: str) -> str:
    """Table of a block from the words of its first line.

    Raises:
        ValueError: an unknown kind.
    """
    kind, *words = head.split()
    if kind not in KINDS:
        raise ValueError(f"generated: {kind}: must be one of {', '.join(KINDS)}")
    return KINDS[kind](*words)


def filled(text: str) -> str:
    """Page with all its blocks as the program has them."""
    return BLOCK.sub(
        lambda found: (
            f"<!-- generated: {found[1]} -->\n{made(found[1])}<!-- /generated -->"
        ),
        text,
    )


def pages() -> list[Path]:
    """Pages with a block."""
    return [
        path
        for path in sorted(DOCS.rglob("*.md"))
        if "<!-- generated: " in path.read_text("utf-8")
    ]


def heads() -> dict[str, str]:
    """First line of each block of the pages, with the name of its page."""
    return {
        found[1]: path.name
        for path in pages()
        for found in BLOCK.finditer(path.read_text("utf-8"))
    }


def stale_blocks(path: Path) -> list[str]:
    """First lines of the blocks of a page that differ from the program."""
    text = path.read_text("utf-8")
    opened = len(re.findall(r"^<!-- generated: ", text, re.M))
    found = list(BLOCK.finditer(text))
    wrong = (
        []
        if len(found) == opened
        else ["a block that is not closed by <!-- /generated -->"]
    )
    return wrong + [each[1] for each in found if each[2] != made(each[1])]


def main(arguments: Sequence[str]) -> Any:
    """Fill the blocks of the named pages, or of all; without ``--write`` name the stale
    ones.
    """
    chosen = [
        Path(name).resolve() for name in arguments if name != "--write"
    ] or pages()
    for path in chosen:
        for head in stale_blocks(path):
            print(f"{path.name}: {head}")
        if "--write" in arguments:
            text = path.read_text("utf-8")
            if (new := filled(text)) != text:
                path.write_text(new, "utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
