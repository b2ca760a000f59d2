"""Elements of XML files: read a file, and numbers from attributes, with errors that
name the element.
"""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Callable, Sequence
from pathlib import Path
from xml.parsers import expat

from skyarm.algebra import Vec3
from skyarm.records.files import PathLike
from skyarm.vehicle import description
from skyarm.vehicle.check import refuse

UNBOUND_PREFIX = expat.errors.codes[expat.errors.XML_ERROR_UNBOUND_PREFIX]

MARKUP = re.compile(rb"<!--(.*?)-->|<!\[CDATA\[.*?\]\]>|<\?.*?\?>", re.DOTALL)
"""Comments, and what may hold the sign of a comment without being one."""

ENCODING = re.compile(
    rb"<\?xml\b[^>]*?\bencoding\s*=\s*[\"'](?!utf-8[\"'])([\w.-]+)", re.IGNORECASE
)
"""Encoding that an XML text declares, unless it is UTF-8."""

COUNTS = {3: "three", 4: "four", 6: "six", 7: "seven"}


def _refuse(error: str) -> None:
    refuse("XML", error, "must be well-formed")


def read_xml(path: PathLike, note: Callable[[str], None] = _refuse) -> ET.Element:
    """Root element of an XML file, as of its text (:func:`parse_xml`)."""
    return parse_xml(Path(path).read_bytes(), note)


def parse_xml(text: bytes, note: Callable[[str], None] = _refuse) -> ET.Element:
    """Root element of an XML text; names keep their prefixes, and blank lines before
    the declaration are skipped.

    Two errors, which the parsers of MuJoCo and ROS let pass, are forgiven where
    ``note`` takes a line on each: prefixes that no ``xmlns`` declares, and ``--`` in
    comments. Document types are refused, and with them entities.

    Raises:
        VehicleError: without the file's name, which the caller adds.
    """
    # expat refuses blank lines before the declaration
    text = text.lstrip()
    # expat knows none of several bytes, such as GB2312
    if declared := ENCODING.match(text):
        try:
            text = text.decode(declared[1].decode()).encode()
        except (LookupError, UnicodeError) as error:
            _refuse(str(error))
    # of equal length, so that positions in error messages stay those of the file
    plain = MARKUP.sub(_plain_comment, text)
    if plain != text:
        note("'--' inside a comment: forgiven")
    # first as prefixes ought to be, then as names that hold them
    for separator in (" ", None):
        tree = ET.TreeBuilder()
        parser = expat.ParserCreate("utf-8" if declared else None, separator)
        parser.StartElementHandler, parser.EndElementHandler = tree.start, tree.end
        parser.CharacterDataHandler = tree.data
        parser.StartDoctypeDeclHandler = _refuse_doctype
        try:
            parser.Parse(plain, True)
        except expat.ExpatError as error:
            forgiven = getattr(error, "code", 0) == UNBOUND_PREFIX
            # unbound prefixes of robots' files are common; any other error is not
            # forgiven
            (note if forgiven else _refuse)(
                f"{error}{', which no xmlns declares: forgiven' if forgiven else ''}"
            )
    return tree.close()


SUFFIXES = {"robot": ".urdf", "sdf": ".sdf", "mujoco": ".xml"}
"""Root element of a file with bodies -> suffix of its name, by which its reader is
chosen."""


def require_root(root: ET.Element, tag: str) -> None:
    """Refuse an XML file of another root element; if it is one that is read, its suffix
    is named.
    """
    if root.tag != tag:
        cure = (
            f"; the name of a file with <{root.tag}> ends in {SUFFIXES[root.tag]}"
            if root.tag in SUFFIXES
            else ""
        )
        refuse("root element", root.tag, f"must be <{tag}>{cure}")


def _refuse_doctype(*_: object) -> None:
    # entities could grow without bound or read other files
    _refuse("document types and entities are not read")


def _plain_comment(match: re.Match[bytes]) -> bytes:
    """Comment of equal length without two hyphens in a row; other markup as it
    stands.
    """
    # only comments are changed: CDATA and processing instructions may hold -- rightly
    return (
        match[0]
        if match[1] is None
        else b"<!--%b-->" % re.sub(rb"-(?=-|\Z)", b" ", match[1])
    )


def child(element: ET.Element, tag: str, field: str) -> ET.Element | None:
    """Child of an XML element with a tag that may occur at most once; None if there is
    no such child.
    """
    # two elements would leave the choice to chance
    children = element.findall(tag)
    if len(children) > 1:
        refuse(
            f"{field}.{tag}", f"{len(children)} elements <{tag}>", "must be at most one"
        )
    return children[0] if children else None


def text_of(element: ET.Element, path: str = ".", usual: str = "") -> str:
    """Text of the first element at a path below another one, or of that one itself; the
    usual one if it is empty.
    """
    return element.findtext(path, "").strip() or usual


def required_numbers(
    element: ET.Element, tag: str, names: Sequence[str], field: str
) -> list[float]:
    """Numbers in the named attributes of a child element; an error if one of them is
    missing.
    """
    entry = child(element, tag, field)
    if entry is None:
        refuse(
            f"{field}.{tag}",
            "(missing)",
            f"must give {', '.join(names)}; a link without mass has no <inertial>",
        )
    for name in names:
        if entry.get(name) is None:
            refuse(f"{field}.{tag}.{name}", "(missing)", "must be a number")
    return [finite(entry.get(name, ""), f"{field}.{tag}.{name}") for name in names]


def number(
    element: ET.Element | None,
    name: str,
    field: str,
    default: float,
    *,
    infinite: bool = False,
) -> float:
    """Read an optional number from an attribute of an XML element; infinity only if it
    is allowed.
    """
    text = None if element is None else element.get(name)
    return (
        default if text is None else finite(text, f"{field}.{name}", infinite=infinite)
    )


def numbers(
    element: ET.Element | None,
    name: str,
    field: str,
    default: tuple[float, float, float],
) -> Sequence[float]:
    """Read three optional numbers from an attribute of an XML element."""
    text = None if element is None else element.get(name)
    return default if text is None else numbers_of(text, f"{field}.{name}", 3)


def centre_of_mass(link: ET.Element) -> Vec3:
    """Centre of mass of a URDF link in its axes, m; its origin if none is stated."""
    origin = link.find("inertial/origin")
    return description.vector(
        numbers(
            origin, "xyz", f"link[{link.get('name')}].inertial.origin", (0.0, 0.0, 0.0)
        )
    )


def numbers_of(text: str, field: str, count: int) -> list[float]:
    """Finite numbers that a text holds: three, six of a pose, four or seven with a
    quaternion.
    """
    entries = text.split()
    if len(entries) != count:
        refuse(field, text, f"must be {COUNTS.get(count, count)} numbers")
    return [finite(entry, field) for entry in entries]


def finite(text: str, field: str, *, infinite: bool = False) -> float:
    """Read a finite number from text."""
    try:
        value = float(text)
    except ValueError:
        # one message for what is no number and what is NaN
        value = math.nan
    if not (math.isfinite(value) or (infinite and math.isinf(value))):
        refuse(
            field, text, "must be a number" if infinite else "must be a finite number"
        )
    return value
