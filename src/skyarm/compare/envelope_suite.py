"""The envelope of laws into a folder: cells, envelope.json, envelope.csv, tables.md, envelope.png, report.html."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from skyarm.compare.cells import Cells
from skyarm.compare.envelope_axes import AXES, Axis
from skyarm.compare.envelope_flights import AxisFlights, Done, axis_flights, perform_axes
from skyarm.compare.envelope_page import envelope_page, envelope_picture
from skyarm.compare.envelope_record import axis_record, points_of, sentence, violations
from skyarm.compare.envelope_setting import DURATION, PAPER, Setting, setting_of
from skyarm.compare.envelope_tables import envelope_csv, envelope_report
from skyarm.control.catalogue import is_named
from skyarm.control.controller import ControllerError
from skyarm.files import write_atomically
from skyarm.registry.plugins import identities

ENVELOPE = "envelope-suite"

LAWS = ("paper_pd", "paper_ct", "l1_adaptive", "centroidal_tip", "centroidal_tip_robust")
"""What flies where nobody chooses; nmpc takes a quarter of an hour more (--laws nmpc)."""

TUNED_LAWS = (
    *("decoupled_pd_tuned", "hybrid_computed_torque_tuned", "l1_adaptive"),
    *("centroidal_tip", "centroidal_tip_robust"),
)
"""The same on another vehicle than the paper's, which the paper's gains are not for."""

QUICK = 10.0
"""s, of a trial where the envelope is to be quick."""


@dataclass(frozen=True, kw_only=True)
class Envelope:
    """What flies.

    Attributes:
        laws: presets or laws, in order. axes: names. vehicle: name or file. seed: of the noise. plant: that flies.
        quick: the first and the last value of each axis only, in flights of 10 s.
    """

    laws: tuple[str, ...] = LAWS
    axes: tuple[str, ...] = tuple(AXES)
    vehicle: str = PAPER
    seed: int = 0
    plant: str = "rigid_body"
    quick: bool = False

    @property
    def setting(self) -> Setting:
        """The vehicle in hover."""
        return setting_of(self.vehicle, QUICK if self.quick else DURATION, self.plant)

    @property
    def flown(self) -> tuple[str, ...]:
        """Axes that the vehicle can fly."""
        servos = bool(self.setting.truth.drives)
        return tuple(name for name in self.axes if not (servos and AXES[name].torques))

    def axis(self, name: str) -> Axis:
        """An axis with the values that fly."""
        axis = AXES[name]
        return dataclasses.replace(axis, values=(axis.values[0], axis.values[-1])) if self.quick else axis


def planned(envelope: Envelope) -> tuple[list[AxisFlights], dict[str, str]]:
    """Cells of an envelope, law by law, and why a law does not fly this vehicle."""
    found: list[AxisFlights] = []
    refused: dict[str, str] = {}
    setting = envelope.setting
    for law in envelope.laws:
        try:
            for name in envelope.flown:
                axis = envelope.axis(name)
                found += axis_flights(law, axis, setting, seed=envelope.seed, plant=envelope.plant)
        except ControllerError as error:
            refused[law] = str(error)
            found = [each for each in found if each.entrant.name != law]
    return found, refused


def fly_envelope(envelope: Envelope, folder: Path, *, threads: int = 1, progress: Done | None = None) -> dict[str, Any]:
    """Fly what is missing, write the folder's files, and return the content of ``envelope.json``.

    Laws that the folder holds from before, flown under the same options, stay in its tables.

    Raises:
        ValueError: no law flies the vehicle.
        OSError: a file cannot be written.
    """
    envelope = with_laws_of(folder, envelope)
    todo, refused = planned(envelope)
    if not todo:
        raise ValueError("; ".join(f"--laws: {law}: {why}" for law, why in refused.items()))
    cells = perform_axes(todo, folder / "cells", threads=threads, progress=progress)
    found = envelope_record(envelope, todo, cells, refused)
    write_envelope(found, folder)
    return found


ORDER = (*LAWS[:2], *TUNED_LAWS[:2], "l1_adaptive", "nmpc", "centroidal_tip", "centroidal_tip_robust")
"""Of laws in tables; others follow."""


def with_laws_of(folder: Path, envelope: Envelope) -> Envelope:
    """The envelope and those laws whose cells a folder holds whole, of the same vehicle, axes and seed."""
    try:
        stored = json.loads((folder / "envelope.json").read_bytes())["laws"]
        others = [law for law in stored if isinstance(law, str) and is_named(law) and law not in envelope.laws]
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        others = []
    cells = Cells(folder / "cells")
    for law in others:
        mine, refused = planned(dataclasses.replace(envelope, laws=(law,)))
        if not refused and all(cells.get(each) is not None for each in mine):
            envelope = dataclasses.replace(envelope, laws=(*envelope.laws, law))
    known = [law for law in ORDER if law in envelope.laws]
    return dataclasses.replace(envelope, laws=(*known, *(law for law in envelope.laws if law not in known)))


SAID = ("vehicle", "seed", "plant", "quick")
"""What an envelope and its record have in common."""


def envelope_record(
    envelope: Envelope, todo: Sequence[AxisFlights], cells: Sequence[Any], refused: Mapping[str, str]
) -> dict[str, Any]:
    """All of an envelope as plain data."""
    axes: dict[str, Any] = {name: axis_record(envelope.axis(name), envelope.setting) for name in envelope.flown}
    for flights, cell in zip(todo, cells, strict=True):
        laws = axes[flights.case.name]["laws"]
        laws.setdefault(flights.entrant.name, []).extend(points_of(cell, flights.axis, len(flights.points)))
    laws = [law for law in envelope.laws if law not in refused]
    found: dict[str, Any] = {
        "schema": 1,
        "suite": ENVELOPE,
        "vehicle": envelope.vehicle,
        "seed": envelope.seed,
        "plant": envelope.plant,
        "quick": envelope.quick,
        "laws": laws,
    }
    if identities():
        found["plugins"] = identities()
    found |= {"not_flown": dict(refused), "sentences": {law: sentence(law, axes) for law in laws}}
    return found | {"violations": violations(axes), "axes": axes}


def write_envelope(found: Mapping[str, Any], folder: Path) -> None:
    """Write every file of the folder but its cells."""
    picture = envelope_picture(found)
    write_atomically(folder / "envelope.png", picture)
    write_atomically(folder / "envelope.json", (json.dumps(found, indent=1, allow_nan=False) + "\n").encode())
    write_atomically(folder / "envelope.csv", envelope_csv(found).encode())
    write_atomically(folder / "tables.md", envelope_report(found).encode())
    write_atomically(folder / "report.html", envelope_page(found, picture).encode())
