"""Elements and numbers of an XML file, each refused by its name where it is not what it must be."""

from __future__ import annotations

import math
import os
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from typing import Any

from skyarm.algebra import Mat3, Vec3
from skyarm.vehicle import description
from skyarm.vehicle.check import VehicleError, refuse


def read_xml(path: str | os.PathLike[str]) -> tuple[ET.Element, bool]:
    """The root element of a file, and whether blank lines before its declaration were skipped.

    Raises:
        VehicleError: without the file's name, which the caller adds.
    """
    with open(path, "rb") as stream:
        content = stream.read()
    begun = content.lstrip()
    try:
        return ET.fromstring(begun), begun[:5] == b"<?xml" and begun != content
    except (ET.ParseError, LookupError, ValueError) as error:  # the last two: encodings
        raise VehicleError(f"XML = {str(error)!r}: must be well-formed") from error


def child(element: ET.Element, tag: str, field: str) -> ET.Element | None:
    """The child element of a kind of which there may be one."""
    found = element.findall(tag)
    if len(found) > 1:
        refuse(f"{field}.{tag}", f"{len(found)} elements <{tag}>", "must be at most one")
    return found[0] if found else None


def required(element: ET.Element, tag: str, names: Sequence[str], field: str) -> list[float]:
    """Numbers of a child element that must be there, with all of them."""
    found = child(element, tag, field)
    if found is None:
        refuse(f"{field}.{tag}", "(missing)", f"must give {', '.join(names)}; a link without mass has no <inertial>")
    for name in names:
        if found.get(name) is None:
            refuse(f"{field}.{tag}.{name}", "(missing)", "must be a number")
    return [finite(found.get(name, ""), f"{field}.{tag}.{name}") for name in names]


def number(element: ET.Element | None, name: str, field: str, default: float, *, infinite: bool = False) -> float:
    """A number that may be left out; infinite only where that means something."""
    text: Any = None if element is None else element.get(name)
    return default if text is None else finite(text, f"{field}.{name}", infinite=infinite)


def numbers(element: ET.Element | None, name: str, field: str, default: tuple[float, float, float]) -> Sequence[float]:
    """Three numbers that may be left out."""
    text: Any = None if element is None else element.get(name)
    if text is None:
        return default
    words = text.split()
    if len(words) != 3:
        refuse(f"{field}.{name}", text, "must be three numbers")
    return [finite(word, f"{field}.{name}") for word in words]


def finite(text: str, field: str, *, infinite: bool = False) -> float:
    """A number in words."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) or (infinite and math.isinf(value))):
        refuse(field, text, "must be a number" if infinite else "must be a finite number")
    return value


def origin_of(element: ET.Element, field: str) -> tuple[Mat3, Vec3]:
    """Rotation and position (m) that an element's <origin> states; none without one."""
    origin = child(element, "origin", field)
    xyz = numbers(origin, "xyz", f"{field}.origin", (0.0, 0.0, 0.0))
    rpy = numbers(origin, "rpy", f"{field}.origin", (0.0, 0.0, 0.0))
    return description.rotation_rpy(rpy), description.vector(xyz)
