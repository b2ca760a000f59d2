"""Whole files made wrong: at bytes, at words, and in their tables, from a fixed
seed.
"""

from __future__ import annotations

import copy
import io
import json
import math
import random
import re
import tomllib
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Callable
from typing import Any

import numpy as np

from skyarm.log.ros import files

DEPTHS = (3, 40, 90, 300, 1000, 3000)

JUNK: tuple[Any, ...] = (
    True,
    False,
    0,
    1,
    -1,
    3,
    2**63,
    10**30,
    10**308,
    10**400,
    10**4000,
    -(10**30),
    0.0,
    -0.0,
    -1.5,
    1e-320,
    1e9,
    1e20,
    1e308,
    -1e308,
    math.nan,
    math.inf,
    -math.inf,
    "",
    " ",
    "x",
    "base",
    "tip",
    "rk4",
    "mujoco",
    "hummingbird",
    "../x",
    "line\nbreak",
    "\x1b[2J\x1b]0;title\x07",
    "\u202egnirts",
    "\u2028",
    "\0",
    "\u00fc" * 300,
    "y" * 5000,
    "%s{}{0}$x",
    [],
    [[]],
    [1],
    [1.0, 2.0],
    [0.0, 0.0, 0.0],
    [1e308] * 3,
    [math.nan] * 3,
    ["a", "b", "c"],
    [[1.0, 0.3]],
    [{}],
    [{}, 1],
    {},
    {"kind": "sine"},
    {"kind": "hover"},
    {"name": "x"},
    {"": 1},
    {"mass": 1e308},
    [0.1] * 500,
)

WORDS: tuple[str, ...] = (
    "1e999",
    "-1e308",
    "nan",
    "inf",
    "-inf",
    "0x" + "f" * 5000,
    "9" * 5000,
    "-" + "9" * 5000,
    "1e-400",
    "1_0",
    "0b1",
    "true",
    '""',
    "''",
    '"""',
    "'''",
    "{",
    "}",
    "[",
    "]",
    "[[",
    "]]",
    "=",
    ".",
    ",",
    "#",
    "\n",
    "\r",
    "\t",
    "\0",
    "\\",
    '"\\u202e"',
    '"\\u0000"',
    "1979-05-27T07:32:00Z",
    "2021-02-30",
    "\ufeff",
    "\ud7ff",
    "\U0010ffff",
    "<a>",
    "</a>",
    "&lt;",
    "&#0;",
    "&x;",
    "<!--",
    "-->",
    "<![CDATA[",
    "<?x ?>",
    "é",
    "٣",
    "\u2028",
)
"""What stands in place of a word of a file."""

Mutation = Callable[[bytes, random.Random], bytes]


def at_bytes(content: bytes, rng: random.Random) -> bytes:
    """Some bytes flipped, inserted, taken out, doubled; the file cut, or begun with a
    mark.
    """
    held = bytearray(content)
    for _ in range(rng.choice((1, 1, 2, 8))):
        at = rng.randrange(len(held) + 1)
        length = rng.choice((1, 1, 4, 64))
        what = rng.randrange(7)
        if what == 0 and at < len(held):
            held[at] ^= 1 << rng.randrange(8)
        elif what == 1:
            held[at:at] = rng.randbytes(length)
        elif what == 2:
            del held[at : at + length]
        elif what == 3:
            held[at:at] = held[at : at + length]
        elif what == 4:
            del held[at:]
        elif what == 5:
            held[:0] = rng.choice(
                (b"\xef\xbb\xbf", b"\xff\xfe", b"\xfe\xff", b"\0", b"\x1b[2J")
            )
        else:
            held[at : at + length] = bytes(length)
    return bytes(held)


def at_words(content: bytes, rng: random.Random) -> bytes:
    """Words and lines exchanged, doubled, taken out, nested deeply, or replaced by what
    no writer would write.
    """
    lines = content.decode().split("\n")
    for _ in range(rng.choice((1, 1, 2, 4))):
        i = rng.randrange(len(lines))
        words = lines[i].split(" ")
        j = rng.randrange(len(words))
        what = rng.randrange(10)
        if what == 0:
            words[j] = rng.choice(WORDS)
        elif what >= 7:
            numbers = [k for k, word in enumerate(words) if re.search("[0-9]", word)]
            k = rng.choice(numbers or [j])
            words[k] = re.sub(
                "[0-9.]+",
                lambda _: rng.choice(("0", "1.5", "0.1", "7", "1e-9", "1e99")),
                words[k],
                count=1,
            )
        elif what == 1:
            words[j] += rng.choice(WORDS)
        elif what == 2:
            depth = rng.choice(DEPTHS)
            opened, closed = rng.choice(
                (("[", "]"), ("{a=", "}"), ("<a>", "</a>"), ("a.", "=1"))
            )
            words[j] = opened * depth + "1" + closed * (depth if closed != "=1" else 1)
        elif what == 3:
            del words[j]
        lines[i] = " ".join(words)
        if what == 4:
            lines.insert(rng.randrange(len(lines)), lines[i])
        elif what == 5:
            del lines[i]
            lines = lines or [""]
        elif what == 6:
            other = rng.randrange(len(lines))
            lines[i], lines[other] = lines[other], lines[i]
    return "\n".join(lines).encode("utf-8", "surrogatepass")


def in_tables(content: bytes, rng: random.Random) -> bytes:
    """A TOML document with values of other types, other tables, and keys that are
    missing, doubled or unknown.
    """
    document = tomllib.loads(content.decode())
    for _ in range(rng.randint(1, 3)):
        places = _places(document)
        if not places:
            break
        container, key = rng.choice(places)
        what = rng.random()
        if what < 0.2:
            del container[key]
        elif what < 0.3 and isinstance(container, dict):
            container[f"{key}_"] = container.pop(key)
        elif what < 0.45:
            other, other_key = rng.choice(places)
            container[key] = copy.deepcopy(other[other_key])
        elif what < 0.5:
            container[key] = _nested(container[key], rng.choice(DEPTHS[:3]))
        elif what < 0.55 and isinstance(container[key], list) and container[key]:
            container[key] = container[key] * rng.choice((2, 10, 40))
        else:
            container[key] = copy.deepcopy(rng.choice(JUNK))
    return "".join(
        f"{_key(key)} = {toml(value)}\n" for key, value in document.items()
    ).encode()


def in_elements(content: bytes, rng: random.Random) -> bytes:
    """An XML document with other attributes, and elements that are missing, doubled,
    moved or renamed.
    """
    root = ET.fromstring(content)
    for _ in range(rng.randint(1, 3)):
        every = list(root.iter())
        element = rng.choice(every)
        what = rng.random()
        if what < 0.5 and element.attrib:
            name = rng.choice(list(element.attrib))
            if what < 0.1:
                del element.attrib[name]
            else:
                junk = [
                    *WORDS,
                    "1 2 3",
                    "1 2",
                    "0 0 0",
                    "nan nan nan",
                    "1e308 1e308 1e308",
                    "trunk",
                    "upper",
                    "fixed",
                ]
                element.set(
                    name,
                    rng.choice([each for each in junk if all(c >= " " for c in each)]),
                )
        elif what < 0.65 and len(element):
            element.remove(rng.choice(list(element)))
        elif what < 0.8:
            element.append(copy.deepcopy(rng.choice(every)))
        elif what < 0.9:
            element.tag = rng.choice(
                (
                    "link",
                    "joint",
                    "origin",
                    "inertial",
                    "mass",
                    "limit",
                    "axis",
                    "loop",
                    "robot",
                )
            )
        else:
            inner = element
            for _ in range(rng.choice(DEPTHS[:3])):
                inner = ET.SubElement(inner, rng.choice(("link", "joint", "a")))
    return ET.tostring(root)


def in_archive(content: bytes, rng: random.Random) -> bytes:
    """An npz archive with members that are missing, of other shapes, types and sizes,
    cut, or no arrays at all.
    """
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    for _ in range(rng.randint(1, 2)):
        name = rng.choice(list(members) or ["info.npy"])
        held = members.get(name, b"")
        what = rng.randrange(7)
        if what == 0:
            members.pop(name, None)
        elif what == 1:
            members[name] = held[: rng.randrange(len(held) + 1)]
        elif what == 2:
            shape = rng.choice(
                (b"(9999999999999,)", b"(-1,)", b"()", b"(1,)", b"(2**99,)", b"'x'")
            )
            members[name] = re.sub(rb"'shape': \([^)]*\)", b"'shape': " + shape, held)
        elif what == 3:
            kind = rng.choice(
                (
                    b"'|O'",
                    b"'<U99'",
                    b"'<c16'",
                    b"'<M8'",
                    b"[('a','<f8')]",
                    b"'" + b"(" * 300 + b"'",
                )
            )
            members[name] = re.sub(rb"'descr': '[^']*'", b"'descr': " + kind, held)
        elif what == 4:
            info = rng.choice(
                (
                    "[" * 100_000,
                    "{}",
                    "1",
                    "[1]",
                    '{"schema": 1}',
                    "9" * 5000,
                    "null",
                    "{",
                    '{"a": NaN}',
                )
            )
            members["info.npy"] = _array(np.array(info))
        elif what == 5:
            members[name] = rng.choice(
                (
                    b"",
                    b"\0" * 100,
                    rng.randbytes(300),
                    members[rng.choice(list(members) or [name])] if members else b"",
                )
            )
        else:
            members[rng.choice(("extra.npy", "../x.npy", "x", "\x1b[2J.npy"))] = held
    stream = io.BytesIO()
    with zipfile.ZipFile(
        stream,
        "w",
        rng.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2)),
    ) as made:
        for name, held in members.items():
            made.writestr(name, held)
    whole = stream.getvalue()
    return at_bytes(whole, rng) if rng.random() < 0.5 else whole


def changed(document: Any, rng: random.Random) -> Any:
    """Plain data with values of other types, or without some; most often at the top."""
    held = copy.deepcopy(document)
    for _ in range(rng.choice((1, 1, 2))):
        places = _places(held)
        top = [place for place in places if place[0] is held]
        container, key = rng.choice(top if rng.random() < 0.5 and top else places)
        if rng.random() < 0.2:
            del container[key]
        else:
            other, other_key = rng.choice(places)
            container[key] = copy.deepcopy(
                rng.choice((*JUNK, other[other_key]) if other_key in other else JUNK)
            )
    return held


def in_description(content: bytes, rng: random.Random) -> bytes:
    """A log whose description was forged, with checksums that fit, in any of its
    formats.
    """
    if content.startswith(b"PK"):
        with np.load(io.BytesIO(content)) as data:
            arrays = {name: data[name] for name in data.files}
        arrays["info"] = np.array(_json(changed(json.loads(str(arrays["info"])), rng)))
        stream = io.BytesIO()
        np.savez(stream, **arrays)
        return stream.getvalue()
    from mcap.reader import make_reader
    from mcap.writer import CompressionType, Writer

    stream = io.BytesIO()
    writer = Writer(stream, compression=CompressionType.NONE)
    writer.start()
    for each in make_reader(io.BytesIO(content)).iter_attachments():
        data = (
            in_description(each.data, rng) if each.name == files.ARRAYS else each.data
        )
        writer.add_attachment(0, 0, each.name, each.media_type, data)
    writer.finish()
    return stream.getvalue()


def _json(document: Any) -> str:
    """Text of plain data; without whole numbers of more digits than Python writes."""
    try:
        return json.dumps(document)
    except ValueError:
        return "{}"


def in_numbers(content: bytes, rng: random.Random) -> bytes:
    """An MJCF file in which whole numbers are others, and elements stand twice or in
    replicates.

    None is huge: what MuJoCo makes of a file has no limit (``SECURITY.md``).
    """
    root = ET.fromstring(content)
    for _ in range(rng.randint(1, 3)):
        every = list(root.iter())
        element = rng.choice(every)
        size = str(rng.choice((-1, 0, 7, 100)))
        what = rng.randrange(4)
        if what == 0:
            tag, names = rng.choice(BULKY)
            below = (
                root
                if tag in ("size", "compiler")
                else ET.SubElement(root, _section(tag))
            )
            ET.SubElement(below, tag, dict.fromkeys(names, size) | _needs(tag))
        elif what == 1:
            count = rng.choice(("0", "2", "7"))
            inner = ET.SubElement(
                rng.choice(list(root.iter("body"))), "replicate", {"count": count}
            )
            inner.append(
                copy.deepcopy(
                    rng.choice(list(root.iter("body")) + list(root.iter("geom")))
                )
            )
        elif what == 2 and element.attrib:
            element.set(rng.choice(list(element.attrib)), size)
        else:
            element.extend([copy.deepcopy(child) for child in element])
    return ET.tostring(root)


def behind_doctype(content: bytes, rng: random.Random) -> bytes:
    """An MJCF file of wrong numbers that MuJoCo's parser finds in a DOCTYPE, where
    ElementTree reads an empty model.
    """
    hidden = in_numbers(content, rng).replace(b'"', b"'")
    return (
        b'<!DOCTYPE mujoco [<!ENTITY a ">%s<!--"> ]><mujoco>harmless</mujoco><!-- -->'
        % hidden
    )


def with_unbound_prefix(content: bytes, rng: random.Random) -> bytes:
    """An XML document of wrong numbers with a prefix that ElementTree refuses and
    MuJoCo's parser takes for a name.
    """
    return in_numbers(content, rng).replace(b"<default", b'<default x:y="1"', 1)


BULKY = (
    ("hfield", ("nrow", "ncol")),
    ("texture", ("width", "height")),
    ("texture", ("width",)),
    ("mesh", ("params",)),
    ("size", ("nkey",)),
    ("size", ("nuser_body",)),
    ("size", ("nuserdata",)),
    ("numeric", ("size",)),
    ("user", ("dim",)),
    ("clock", ("nsample",)),
    ("clock", ()),
    ("contact", ("num",)),
    ("general", ("actdim",)),
    ("flexcomp", ("count",)),
)
"""Elements that a size makes large, and its attributes."""


def _section(tag: str) -> str:
    places = {
        "numeric": "custom",
        "user": "sensor",
        "clock": "sensor",
        "contact": "sensor",
        "general": "actuator",
    }
    return places.get(tag, "worldbody" if tag == "flexcomp" else "asset")


def _needs(tag: str) -> dict[str, str]:
    """What the element must have besides."""
    return {
        "hfield": {"name": "h", "size": "1 1 1 1"},
        "texture": {"name": "t", "builtin": "flat", "type": "2d"},
        "mesh": {"name": "m", "builtin": "supersphere"},
        "numeric": {"name": "n", "data": "1"},
        "clock": {"delay": "0.1"},
        "general": {"joint": "pitch", "dyntype": "user"},
        "flexcomp": {"name": "f", "type": "grid"},
    }.get(tag, {})


def _array(values: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.save(stream, values)
    return stream.getvalue()


def _nested(value: Any, depth: int) -> Any:
    for _ in range(depth):
        value = [value]
    return value


def _places(node: Any) -> list[tuple[Any, Any]]:
    """Every (container, key) of a document."""
    found: list[tuple[Any, Any]] = []
    waiting = [node]
    while waiting:
        held = waiting.pop()
        items = (
            held.items()
            if isinstance(held, dict)
            else enumerate(held)
            if isinstance(held, list)
            else ()
        )
        for key, child in items:
            found.append((held, key))
            waiting.append(child)
    return found


def _key(key: str) -> str:
    return toml(key)


def toml(value: Any) -> str:
    """TOML text of a value (inline tables)."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return (
            "{"
            + ", ".join(f"{_key(key)} = {toml(inner)}" for key, inner in value.items())
            + "}"
        )
    if isinstance(value, list):
        return "[" + ", ".join(toml(inner) for inner in value) + "]"
    if isinstance(value, str):
        return json.dumps(value).replace("\x7f", "\\u007f")
    if isinstance(value, int):
        return hex(value) if value > 10**300 else str(value)
    return repr(value)
