"""``skyarm margins`` and ``skyarm basin``: what they print and write."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Sequence
from typing import Any

from rich.console import Console
from rich.text import Text

from skyarm.cli.lines import say, say_if_many, say_unlikely
from skyarm.cli.loop_margin_table import NOTE as LOOP_NOTE
from skyarm.cli.loop_margin_table import loop_rows
from skyarm.cli.machine_output import give
from skyarm.cli.progress import bar, waiting
from skyarm.cli.shipped_names import require_not_another
from skyarm.cli.terminal_tables import aligned
from skyarm.control.catalogue import choices, is_named, meant
from skyarm.control.safety import with_safety_layer
from skyarm.control.safety.safety_layer import SafetyParameters
from skyarm.files import output_file, require_writable, shown, taken_back, write_atomically
from skyarm.registry.plugins import identities, law_of_file_name
from skyarm.scenario.controller_table import is_gains_file
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import Scenario
from skyarm.scenario.unlikely_numbers import unlikely_numbers

OWN = "own"
"""Stands for the scenario's own controller."""

DPI = 160

GAINS = {"rotor_gain": "rotors", "one_rotor": "one rotor", "joint_gain": "joints", "one_joint": "one joint"}
"""Field of the margins -> head of its column."""

NOTE = """\
max |z|: spectral radius; slowest: largest real part of a rate, 1/s; delay:
further dead time it bears, ms; rotors, joints: factors on the actuators'
effect it bears, common to all of them, or (one) on that of any single rotor
or joint, the others as they are. The worse of two linearisations, with the
rotors' time constant upward and with that downward. Instants along a flight
are frozen in time, and no proof that it is stable."""

MOST_INSTANTS = 10_000
"""Along a flight: each takes about half a second."""


def law_and_scenario(first: str, more: Sequence[str], controller: str | None) -> tuple[str, str]:
    """Controller and scenario of ``COMMAND SCENARIO [--controller LAW]``, and of the old ``COMMAND LAW SCENARIO``.

    The old order is taken until version 0.3, with a line that says the new one (:func:`say_new_order`).

    Raises:
        ValueError: the law is named twice, or there are more words.
    """
    if not more:
        return OWN if controller is None else controller, first
    if len(more) > 1:
        raise ValueError(f"{shown(' '.join(more[1:]))}: must be left out: one scenario at a time")
    if controller is not None:
        raise ValueError(f"controller = {shown(controller)}: must be named once; {shown(first)} stands before it")
    return first, more[0]


def say_new_order(command: str, first: str, more: Sequence[str]) -> None:
    """Where the old order was used, say the new one; after the work, so that wrong input stays one line."""
    if more:
        option = "" if first == OWN else f" --controller {first}"
        say(f"'skyarm {command} LAW SCENARIO' is now: skyarm {command} {more[0]}{option}")


def planned(controller: str, scenario: str, *, safety: bool) -> Scenario:
    """A scenario with another controller on its own model and clocks, with the safety layer where it says so.

    Args:
        controller: a preset, a law, LAW_tuned, or "own" for the scenario's.
        scenario: a name or a file.
        safety: put the safety layer around it whatever the scenario says.

    Raises:
        ValueError: one line.
    """
    if controller != OWN and not is_named(controller) and not is_gains_file(controller):
        raise ValueError(f"controller = {shown(controller)}: {meant(controller)}must be {OWN!r}, {choices(controller)}")
    require_not_another(scenario, "scenario")
    loaded = load_scenario(scenario, controller=None if controller == OWN else controller)
    say_if_many(loaded.name, loaded.world.vehicle.n)
    say_unlikely(loaded.name, unlikely_numbers(loaded))
    if not safety or isinstance(loaded.controller.par, SafetyParameters):
        return loaded
    return dataclasses.replace(loaded, controller=with_safety_layer(loaded.controller))


def margins(
    scenario: Scenario,
    instants: int,
    name: str | None,
    console: Console,
    *,
    every: bool = False,
    html: str | None = None,
) -> bool:
    """Print margins in hover and along the scenario, write them as JSON; False where the flight ended early.

    ``every`` lists each loop that was cut, not the weakest of each group only; ``html`` is the file of a page.

    Raises:
        ValueError, OSError: one line.
    """
    from skyarm.stability.along import evidence
    from skyarm.stability.frozen_scenario import without_adaptation

    if not 0 <= instants <= MOST_INSTANTS:
        raise ValueError(f"--instants = {instants}: must be from 0 to {MOST_INSTANTS}")
    file = None if name is None else output_file(name, "--out")
    page = None if html is None else output_file(html, "--html")
    held = without_adaptation(scenario)
    with bar(scenario.name, console) as advance:
        found = evidence(held, instants, lambda done, total: advance(done, total, "instants"))
    rows = [("at", "max |z|", "slowest", "damping", "delay", *GAINS.values())]
    for each in found.instants:
        rates = [s for m in each.by_lag.values() for s in m.s]
        cells = (
            "hover" if each.hover else f"{each.time:.2f} s",
            f"{each.radius:.6f}",
            f"{max((s.real for s in rates), default=-math.inf):.3g}",
            f"{_damping(rates):.2f}",
            _number(1e3 * each.delay),
            *("-".join(_factor(k) for k in each.gain(field)) for field in GAINS),
        )
        rows.append(cells)
    console.print(Text(f"{found.controller} in {found.scenario}", style="bold"))
    for line in aligned(rows):
        console.print(line, soft_wrap=True)
    console.print(NOTE, soft_wrap=True)
    if found.instants:
        least = min(each.swings for each in found.instants)
        borne = "more than 100" if math.isinf(least) else _number(1e3 * least)
        console.print(f"small swings grow in flight from {borne} ms of further dead time on", soft_wrap=True)
    console.print()
    for line in aligned(loop_rows(found, every=every)):
        console.print(line, soft_wrap=True)
    console.print(LOOP_NOTE, soft_wrap=True)
    if held is not scenario:
        console.print("the law's slow adaptation of load and friction is held")
    if found.left_out:
        console.print(f"disturbances are left out: {', '.join(found.left_out)}", soft_wrap=True)
    if scenario.changes:
        console.print(
            "changes in flight are left out: these are the margins of the scenario as it begins", soft_wrap=True
        )
    if not found.completed:
        console.print("the flight ended before its time: no instants beyond")
    give(_plain(found) | _plugins() | ({} if page is None else {"page": page}))
    if page is not None:
        from skyarm.cli.loop_margin_page import write_page
        from skyarm.stability.along import hover_loci

        write_page(found, hover_loci(scenario), page)
        console.print(f"page: {page}", soft_wrap=True)
    if file is not None:
        write_atomically(file, (json.dumps(_plain(found) | _plugins(), indent=1, allow_nan=False) + "\n").encode())
        console.print(f"written: {file}", soft_wrap=True)
    return bool(found.completed)


def _damping(rates: list[complex]) -> float:
    """Smallest damping ratio of the oscillating eigenvalues; 1 without any."""
    return min((-s.real / abs(s) for s in rates if s.imag != 0.0 and abs(s) > 0.0), default=1.0)


def _factor(value: float) -> str:
    """A factor in at most four characters: a range of two fits its column."""
    if math.isinf(value):
        return "none"
    return f"{value:.0f}" if value >= 99.95 else f"{value:.1f}" if value >= 9.995 else f"{value:.2f}"


def _number(value: float) -> str:
    return "none" if math.isinf(value) else f"{value:.3g}"


def _finite(value: float) -> float | None:
    """A number of strict JSON; null stands for none found."""
    return value if math.isfinite(value) else None


def _plugins() -> dict[str, Any]:
    """Which plugins and files of laws took part, by name and digest; empty without any."""
    return {"plugins": identities()} if identities() else {}


def _plain(found: Any) -> dict[str, Any]:
    """Evidence as plain data."""
    return {
        "schema": 1,
        "controller": found.controller,
        "scenario": found.scenario,
        "completed": found.completed,
        "left_out": list(found.left_out),
        "instants": [
            {
                "hover": each.hover,
                "time": each.time,
                "swings_from": _finite(each.swings),
                "lag": {
                    lag: {
                        "radius": m.radius,
                        "z": [[float(z.real), float(z.imag)] for z in m.z],
                        "s": [[_finite(float(s.real)), _finite(float(s.imag))] for s in m.s],
                        "delay_margin": _finite(m.delay),
                        "rotor_gain": [_finite(k) for k in m.rotor_gain],
                        "joint_gain": [_finite(k) for k in m.joint_gain],
                        "one_rotor": [_finite(k) for k in m.one_rotor],
                        "one_joint": [_finite(k) for k in m.one_joint],
                        "loops": [one.plain() for one in m.loops],
                        "together": [several.plain() for several in m.together],
                    }
                    for lag, m in each.by_lag.items()
                },
            }
            for each in found.instants
        ],
    }


def basin(
    scenario: Scenario,
    flights: int,
    out: str,
    threads: int,
    limits: dict[str, float],
    console: Console,
    label: str = "",
) -> None:
    """Fly a controller from many initial states; write the map as PNG and JSON.

    Raises:
        ValueError, OSError: one line.
    """
    from skyarm.figures.share_maps import basin_figure
    from skyarm.figures.style import image_bytes
    from skyarm.stability.basin import CAUGHT
    from skyarm.stability.basin import basin as fly

    seed = int(limits.pop("seed"))
    with taken_back(out):
        folder = require_writable(out)
        with waiting(f"{scenario.name}: {flights} flights", console):
            found = fly(scenario, flights, seed=seed, threads=threads, **limits)
    flown = law_of_file_name(label) if label and label != OWN else found.controller
    # a map with the safety layer is another map
    if isinstance(scenario.controller.par, SafetyParameters) and not flown.startswith("guarded_"):
        flown = f"guarded_{flown}"
    name = f"basin_{flown}_{scenario.name}"
    give(found.plain() | _plugins(), files=[folder / f"{name}.png", folder / f"{name}.json"])
    text = json.dumps(found.plain() | _plugins(), indent=1, allow_nan=False) + "\n"
    write_atomically(folder / f"{name}.json", text.encode())
    write_atomically(folder / f"{name}.png", image_bytes(basin_figure(found), dpi=DPI))
    if scenario.changes:
        console.print("changes in flight are left out: this is the basin of the scenario as it begins", soft_wrap=True)
    upside = found.tilt > 0.5 * math.pi
    console.print(
        f"{found.controller}: {found.caught.mean():.2%} of {flights} flights caught, {found.returned.mean():.2%} back "
        f"on their reference; of {int(upside.sum())} that began upside down "
        f"{found.caught[upside].mean() if upside.any() else 0.0:.2%}",
        soft_wrap=True,
    )
    console.print(f"caught: {CAUGHT}", soft_wrap=True)
    console.print(f"map in {folder}: {name}.png, {name}.json", soft_wrap=True)
