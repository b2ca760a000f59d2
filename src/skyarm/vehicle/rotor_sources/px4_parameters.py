"""Rotors of PX4's control allocation: CA_ROTOR* in a parameter file, an airframe's shell file or a ULog.

PX4's axes are forward, right, down; its places count from the centre of mass, and only their ratios matter to it, as
only the sign of KM does. Source: PX4, src/modules/control_allocator/module.yaml and ActuatorEffectivenessRotors.cpp.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from skyarm.records.files import needs_extra
from skyarm.vehicle import description
from skyarm.vehicle.check import refuse
from skyarm.vehicle.stated_rotors import RotorFile, StatedRotor
from skyarm.vehicle.xml_elements import finite

STATED = re.compile(
    r"^[ \t]*(?:param[ \t]+set(?:-default)?(?:[ \t]+-\w)*|\d+[ \t]+\d+)[ \t]+(CA_ROTOR\w+)[ \t]+(\S+)", re.MULTILINE
)
"""Line of an airframe's shell file, or of QGroundControl's parameter file."""

USUAL = {"PX": 0.0, "PY": 0.0, "PZ": 0.0, "AX": 0.0, "AY": 0.0, "AZ": -1.0, "KM": 0.05, "TILT": 0.0}
"""PX4's own defaults, which a file leaves out."""

MOST = 12
"""Number of rotors that PX4 has parameters for."""

ABSENT = {
    "thrust_coefficient": "CA_ROTOR*_CT is per squared output, not speed",
    "moment_coefficient": "CA_ROTOR*_KM counts by its sign only",
}


def px4_rotors(file: RotorFile) -> tuple[StatedRotor, ...]:
    """Rotors of PX4's parameters, by their numbers; their places are scaled by ``arm_length`` (m), the longest arm."""
    if file.content is not None or file.path.suffix in (".yaml", ".yml"):
        return ()
    stated = _parameters(file.path)
    if not stated:
        return ()
    count = stated.get("CA_ROTOR_COUNT", 0.0)
    if count not in range(1, MOST + 1):
        refuse("CA_ROTOR_COUNT", count, f"must be 1 ... {MOST}")
    rotors = [{word: stated.get(f"CA_ROTOR{k}_{word}", value) for word, value in USUAL.items()} for k in range(int(count))]
    longest = max(math.hypot(each["PX"], each["PY"], each["PZ"]) for each in rotors)
    scale = None
    if file.settings.take("arm_length", None) is not None and longest:
        scale = file.settings.number("arm_length", low=0.0, strict=True) / longest
    return tuple(_rotor(f"rotor_{k}", each, longest, scale) for k, each in enumerate(rotors))


def _parameters(path: Path) -> dict[str, float]:
    pairs: Iterable[tuple[str, Any]] = STATED.findall(path.read_text("utf-8", "replace"))
    if path.suffix == ".ulg":
        pairs = ((name, value) for name, value in _of_log(path).items() if name.startswith("CA_ROTOR"))
    values: dict[str, float] = {}
    for name, text in pairs:
        value = finite(str(text), name)
        if values.setdefault(name, value) != value:
            refuse(name, text, f"stands twice in the file, with {values[name]:g} before; must be one value")
    return values


def _of_log(path: Path) -> Mapping[str, Any]:
    try:
        from pyulog import ULog
    except ImportError:
        refuse("file", path.name, f"a log of PX4 {needs_extra('flights')}")
    try:
        return dict(ULog(str(path), [], parse_header_only=True).initial_parameters)
    except Exception as error:  # whatever pyulog meets in a damaged file
        refuse("file", path.name, f"must be a log of PX4 ({type(error).__name__})")


def _rotor(name: str, each: Mapping[str, float], longest: float, scale: float | None) -> StatedRotor:
    values, absent = {}, dict(ABSENT)
    if each["KM"]:
        values["direction"] = 1 if each["KM"] > 0.0 else -1
    if scale is None:
        absent["position"] = (
            f"[rotor_file] arm_length, m, gives it: places are relative, the longest arm {longest:g} in the file"
        )
    if each["TILT"]:
        absent["tilt"] = "CA_ROTOR*_TILT names a servo only"
    place = [(scale or 0.0) * length for length in (each["PX"], -each["PY"], -each["PZ"])]
    where = {
        "direction": "sign of CA_ROTOR*_KM",
        "position": "CA_ROTOR*_PX, PY, PZ times arm_length over the longest arm; PX4's origin, the centre of mass, is "
        "taken for the base's",
        "axis": "CA_ROTOR*_AX, AY, AZ",
    }
    return StatedRotor(
        name=name,
        position=description.vector(place),
        axis=description.unit_axis(f"{name}: CA_ROTOR*_AX, AY, AZ", [each["AX"], -each["AY"], -each["AZ"]]),
        values=values,
        where=where,
        absent=absent,
    )
