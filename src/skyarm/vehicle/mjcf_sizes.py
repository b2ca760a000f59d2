"""Size limits of an MJCF file, checked before MuJoCo compiles it: a line of XML can take gigabytes or hours.

Elements count as often as ``<replicate>``, ``<include>`` and ``<attach>`` repeat them; heights, pixels, vertices and
buffers count as numbers. MuJoCo compiles what is within these limits in seconds; it heeds no signal meanwhile.
"""

from __future__ import annotations

import math
import struct
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from typing import NoReturn

from skyarm.files import shown
from skyarm.vehicle.check import VehicleError

MOST_TEXT = 10e6
"""Bytes of XML, with the files that it includes and attaches."""

MOST_DATA = 100e6
"""Bytes of the files of meshes, heights, textures and skins, each as often as an element names it."""

MOST_ELEMENTS = 5000
"""Elements: MuJoCo takes 1 to 3 s for so many, four times as long for twice as many."""

MOST_NUMBERS = 2e7
"""Numbers of the compiled model, weighed by what they take to compile."""

HEIGHT, VERTEX, SAMPLE, STEP = 4, 400, 32, 4
"""Weights: of a height, for its bounding volume; of a vertex of a built-in mesh, for its hull; of a sample of a sensor
that is logged, for the most numbers that one sensor has; of an element that moves for a step."""

FLEXIBLE = ("composite", "flexcomp", "flex")

WITH_FILES = ("mesh", "hfield", "texture", "skin")

OF_NOTHING = ("clock", "e_potential", "e_kinetic", "user", "contact", "plugin")
"""Sensors that may be of no object: MuJoCo doubles them with each copy that ``<replicate>`` or ``<attach>`` makes."""

OBJECTS = ("objname", "site", "geom1", "geom2", "body1", "body2", "subtree1", "subtree2")
"""Attributes that name the object of such a sensor."""

FOLDERS = ("assetdir", "meshdir", "texturedir")

PNG = b"\x89PNG\r\n\x1a\n"


def xml_root(path: Path) -> ET.Element:
    """Root element of an XML file that ElementTree and MuJoCo's own parser, tinyxml2, read alike.

    Raises:
        VehicleError: one line, without the file's name: it is not well-formed, has a DOCTYPE or a default namespace.
    """
    content = path.read_bytes().lstrip()
    # tinyxml2 ends a DOCTYPE at its first ">", wherever that stands
    if b"<!DOCTYPE" in content:
        raise VehicleError("XML: has a DOCTYPE, must have none")
    try:
        root = ET.fromstring(content)
    except (ET.ParseError, LookupError, ValueError) as error:
        raise VehicleError(f"XML = {str(error)!r}: must be well-formed") from None
    # ElementTree puts a namespace before the name, tinyxml2 knows none
    if any(element.tag.startswith("{") for element in root.iter()):
        raise VehicleError("XML: has elements of a namespace, must have none")
    return root


def require_bounded(path: Path, root: ET.Element) -> None:
    """Refuse a file whose model would be too large.

    Raises:
        VehicleError: one line, without the file's name: the element, how much it takes, how much is allowed.
    """
    found = _Expansion(path, root)
    if not (moved := found.simulated()) <= MOST_NUMBERS:
        _refuse("actuator", f"{moved:.3g} elements times steps to find ranges of length", MOST_NUMBERS)
    total = 0.0
    for element, times in found.kept:
        total += times * found.numbers(element)
        if not total <= MOST_NUMBERS:
            _refuse(element.tag, f"{total:.3g} numbers", MOST_NUMBERS)


class _Expansion:
    """The elements of a file with those that it includes and attaches, and how often each is repeated."""

    def __init__(self, path: Path, root: ET.Element) -> None:
        self.kept: list[tuple[ET.Element, float]] = []
        self._defaults: dict[str, float] = {}
        self._models: set[tuple[str | None, str]] = set()
        self._folders, self._inside = {path.parent: None}, {"": None}
        self._elements, self._copies, self._data = 0.0, 0.0, 0
        self._roots = {path.resolve(): root}
        self._text = path.stat().st_size
        attached = self._walk(root, 1)
        while attached:
            element, times = attached.pop()
            named = [file for name, file in sorted(self._models, key=str) if name in (None, element.get("model"))]
            for file in named:
                for inner in self._parsed(file):
                    attached += self._walk(inner, times)
        for element, times in self.kept:
            if element.tag in OF_NOTHING and self._copies and not any(name in element.attrib for name in OBJECTS):
                self._count("elements", element, times * 2.0 ** min(self._copies, 1000.0))

    def _walk(self, root: ET.Element, times: float) -> list[tuple[ET.Element, float]]:
        """Keep a tree; returns what it attaches."""
        attached: list[tuple[ET.Element, float]] = []
        waiting = [(root, times, False)]
        while waiting:
            element, times, default = waiting.pop()
            if element.tag in FLEXIBLE:
                raise VehicleError(f"<{element.tag}>: is flexible, must be rigid bodies only")
            self._count("elements", element, times)
            if element.tag == "size":
                self._count("keyframes", element, times * _number(element.get("nkey", "")))
            self.kept.append((element, times))
            default = default or element.tag == "default"
            if default:
                for name, value in element.attrib.items():
                    self._defaults[name] = max(self._defaults.get(name, 0.0), _product(value))
            if element.tag == "compiler":
                self._inside |= {element.get(name, ""): None for name in FOLDERS}
            if element.tag == "model":
                self._models.add((element.get("name"), element.get("file", "")))
            elif element.tag == "attach":
                attached.append((element, times))
                self._copies += times
            elif element.tag == "replicate":
                times *= max(1.0, _number(element.get("count", "")))
                self._copies += times
            elif element.tag in WITH_FILES:
                self._weigh(element)
            inside = list(self._parsed(element.get("file", ""))) if element.tag == "include" else [element]
            waiting += [(child, times, default) for each in inside for child in each]
        return attached

    def _count(self, what: str, element: ET.Element, times: float) -> None:
        self._elements += times
        if self._elements > MOST_ELEMENTS:
            _refuse(element.tag, f"{self._elements:.3g} {what}", MOST_ELEMENTS)

    def _parsed(self, name: str) -> Iterator[ET.Element]:
        """Roots of the files that a name may mean; one that cannot be read here is refused, for MuJoCo may read it."""
        for file in self._files(name):
            if file.resolve() not in self._roots:
                self._text += file.stat().st_size
                if self._text > MOST_TEXT:
                    _refuse("include", f"{self._text} bytes of XML", MOST_TEXT)
                self._folders[file.parent] = None
                try:
                    self._roots[file.resolve()] = xml_root(file)
                except VehicleError as error:
                    raise VehicleError(f"file = {shown(name)}: {error}") from None
            yield self._roots[file.resolve()]

    def _weigh(self, element: ET.Element) -> None:
        """Add the sizes of an element's files."""
        for name, value in element.attrib.items():
            if name.startswith("file"):
                self._data += max((file.stat().st_size for file in self._files(value)), default=0)
        if self._data > MOST_DATA:
            _refuse(element.tag, f"{self._data} bytes of files", MOST_DATA)

    def _files(self, name: str) -> list[Path]:
        """Files that a name may mean: beside those that were read, in their folders of meshes and textures."""
        found = []
        for folder in self._folders:
            for middle in self._inside:
                for each in dict.fromkeys([Path(name), Path(Path(name).name)]):
                    try:
                        if (folder / middle / each).is_file():
                            found.append(folder / middle / each)
                    except (OSError, ValueError):  # a name that no file can have
                        continue
        return found

    def numbers(self, element: ET.Element) -> float:
        """Numbers that an element adds to the model, weighed."""

        def of(name: str) -> float:
            return _product(element.get(name, "")) if name in element.attrib else self._defaults.get(name, 0.0)

        if element.tag in ("hfield", "texture"):
            stated = (
                of("nrow") * of("ncol") if element.tag == "hfield" else of("width") * (of("height") or 6 * of("width"))
            )
            named = [value for name, value in element.attrib.items() if name.startswith("file")]
            read = max((_pixels(file) for value in named for file in self._files(value)), default=0)
            return (HEIGHT if element.tag == "hfield" else 1) * max(stated, read)
        if element.tag == "mesh" and "builtin" in element.attrib:
            return VERTEX * max(map(_number, element.get("params", "").split()), default=0.0) ** 2
        if element.tag == "size":
            users = sum(_number(value) for name, value in element.attrib.items() if name.startswith("nuser_"))
            return of("nuserdata") + self._elements * users
        if element.tag == "camera":
            return of("resolution") * self._times("rangefinder")
        if element.tag == "numeric":
            return of("size")
        return of("dim") + of("actdim") + SAMPLE * max(of("nsample"), of("num"), of("nsample") * of("num"))

    def simulated(self) -> float:
        """Elements times steps of the simulations that find the ranges of actuators' lengths; by default of muscles."""
        asked = [element for element, _ in self.kept if element.tag == "lengthrange"]
        steps = [
            _number(each.get("inttotal", "10")) / (_number(each.get("timestep", "0.01")) or 1e-300) for each in asked
        ]
        every = any(each.get("mode") == "all" for each in asked)
        again = any(each.get("useexisting") == "false" for each in asked)
        muscles = any("muscle" in (element.tag, *element.attrib.values()) for element, _ in self.kept)
        moved = [
            times * sum(again or "lengthrange" not in actuator.attrib for actuator in element)
            for element, times in self.kept
            if element.tag == "actuator" and (every or muscles)
        ]
        return STEP * self._elements * sum(moved) * max(steps, default=1000.0)

    def _times(self, tag: str) -> float:
        return sum(times for element, times in self.kept if element.tag == tag)


def _number(text: str) -> float:
    """A number's size; 0 for none, which MuJoCo refuses."""
    try:
        value = abs(float(text))
    except ValueError:
        return 0.0
    return 0.0 if math.isnan(value) else value


def _product(text: str) -> float:
    return math.prod(map(_number, text.split())) if text else 0.0


def _pixels(file: Path) -> float:
    """Of a PNG file, by its header."""
    try:
        with file.open("rb") as stream:
            head = stream.read(24)
    except OSError:
        return 0.0
    width, height = struct.unpack(">II", head[16:24]) if head.startswith(PNG) and len(head) == 24 else (0, 0)
    return float(width * height)


def _refuse(tag: str, found: str, most: float) -> NoReturn:
    raise VehicleError(f"<{tag}>: {found} up to here, must be at most {most:.0f} in the file")
