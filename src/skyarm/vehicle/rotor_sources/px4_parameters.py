"""Rotors of PX4's control allocation: CA_ROTOR* and CA_R_REV in a parameter file, an
airframe's shell file or a ULog.

PX4's axes are forward, right, down; its places count from the centre of mass, and only
their ratios matter to it, as only the sign of KM does. Source: PX4,
src/modules/control_allocator/module.yaml and ActuatorEffectivenessRotors.cpp.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from io import BytesIO
from pathlib import Path
from typing import Any

from skyarm.records.files import needs_extra
from skyarm.vehicle import description
from skyarm.vehicle.check import refuse
from skyarm.vehicle.stated_rotors import RotorFile, StatedRotor
from skyarm.vehicle.xml_elements import finite

STATED = re.compile(
    r"^[ \t]*(?:param[ \t]+set(?:-default)?(?:[ \t]+-\w)*|\d+[ \t]+\d+)["
    r" \t]+(CA_R(?:OTOR\w+|_REV))[ \t]+(\S+)",
    re.MULTILINE,
)
"""Line of an airframe's shell file, or of QGroundControl's parameter file."""

USUAL = {
    "PX": 0.0,
    "PY": 0.0,
    "PZ": 0.0,
    "AX": 0.0,
    "AY": 0.0,
    "AZ": -1.0,
    "KM": 0.05,
    "TILT": 0.0,
}
"""PX4's own defaults, which a file leaves out."""

MOST = 12
"""Number of rotors that PX4 has parameters for."""

ABSENT = {
    "thrust_coefficient": "CA_ROTOR*_CT is per squared output, not speed",
    "moment_coefficient": "CA_ROTOR*_KM counts by its sign only",
}

REVERSED = "CA_R_REV"
"""Parameter with a bit for each rotor, the lowest for the first: set of one that turns
backwards, too."""

WHERE = {
    "reversible": REVERSED,
    "direction": "sign of CA_ROTOR*_KM",
    "position": (
        "CA_ROTOR*_PX, PY, PZ from the base's origin, to PX4 the centre of mass, scaled"
        " to arm_length"
    ),
}


def px4_rotors(file: RotorFile) -> tuple[StatedRotor, ...]:
    """Rotors of PX4's parameters, by their numbers; their places are scaled by
    ``arm_length`` (m), the longest arm.
    """
    # YAML files belong to eagle-mpc, and XML files state rotors of their own
    stated = (
        _parameters(file.path)
        if file.content is None and file.path.suffix not in (".yaml", ".yml")
        else {}
    )
    if not stated.keys() - {REVERSED}:
        return ()
    count = stated.get("CA_ROTOR_COUNT", 0.0)
    if count not in range(1, MOST + 1):
        refuse("CA_ROTOR_COUNT", count, f"must be 1 ... {MOST}")
    backwards = stated.get(REVERSED, 0.0)
    if backwards not in range(2**MOST):
        refuse(
            REVERSED,
            backwards,
            f"must be a whole number from 0 to {2**MOST - 1}: a bit for each rotor",
        )
    rotors = [
        [stated.get(f"CA_ROTOR{k}_{word}", USUAL[word]) for word in USUAL]
        for k in range(int(count))
    ]
    # places are ratios to PX4, so one length in metres scales them all
    longest = max(math.hypot(*each[:3]) for each in rotors)
    relative = (
        f"[rotor_file] arm_length, m, scales them: the longest arm is {longest:g} in"
        " the file"
    )
    scale = 1.0
    absent = {**ABSENT, "position": relative}
    if longest and file.settings.states("arm_length"):
        scale = file.settings.number("arm_length", low=0.0, strict=True) / longest
        absent = ABSENT
    return tuple(
        StatedRotor(
            f"rotor_{k}",
            # from forward, right, down to forward, left, up
            position=description.vector([scale * x, -scale * y, -scale * z]),
            axis=description.unit_axis(f"CA_ROTOR{k}_AX, AY, AZ", [ax, -ay, -az]),
            # a KM of zero has no sign, so the direction is a gap
            values=({"direction": int(math.copysign(1, km))} if km else {})
            | ({"reversible": True} if int(backwards) >> k & 1 else {}),
            where=WHERE,
            absent=(
                {**absent, "tilt": "CA_ROTOR*_TILT names a servo only"}
                if tilt
                else absent
            ),
        )
        for k, (x, y, z, ax, ay, az, km, tilt) in enumerate(rotors)
    )


def _parameters(path: Path) -> dict[str, float]:
    """Parameters CA_ROTOR* of a file by name."""
    pairs: Iterable[tuple[str, Any]] = STATED.findall(
        path.read_text("utf-8", "replace")
    )
    if path.suffix == ".ulg":
        try:
            from pyulog import ULog

            pairs = ULog(
                BytesIO(path.read_bytes()), [], parse_header_only=True
            ).initial_parameters.items()
        except ImportError:
            refuse("file", path.name, needs_extra("flights"))
        except Exception as error:  # whatever pyulog meets in a damaged file
            refuse("file", path.name, f"must be a log of PX4 ({type(error).__name__})")
    values: dict[str, float] = {}
    for name, text in pairs:
        if (
            name.startswith(("CA_ROTOR", REVERSED))
            # two files of parameters in one, with different values, would leave the
            # choice to chance
            and values.setdefault(name, value := finite(str(text), name)) != value
        ):
            refuse(
                name,
                text,
                f"stands twice, with {values[name]:g} before; must be one value",
            )
    return values
