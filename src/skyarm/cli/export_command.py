"""``skyarm export-c``: which controller, for which vehicle, into which file."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from skyarm import __version__
from skyarm.actuation import AllocationError
from skyarm.cli.lines import say_if_many
from skyarm.cli.machine_output import give
from skyarm.cli.said_margin import margin_said, plain_margin
from skyarm.control.catalogue import choices, is_named, meant
from skyarm.control.controller import Controller
from skyarm.control.model import Model
from skyarm.estimate.error_state_filter import ErrorStateFilter
from skyarm.files import number, output_file, read_toml, shown, unreadable, write_atomically
from skyarm.files.kinds_of_files import kind_of
from skyarm.onboard.export_c import export_c
from skyarm.registry.plugins import identities, law_of_file_name
from skyarm.scenario.controller_table import make_named_or_tuned
from skyarm.scenario.scenario_file import list_scenarios, load_scenario
from skyarm.scenario.scenario_record import HIGHEST_RATE, Scenario, without_law
from skyarm.stability.hover_delay import hover_of
from skyarm.vehicle.vehicle_files import load_vehicle

RATE = 200.0
"""Hz, as the scenarios' own default."""

FASTEST_HOVER, MOST_JOINTS = 2000, 12
"""Hz and joints up to which the delay margin is asked for: it takes 3 s for six joints at 200 Hz."""

SLOWEST = 1e-3
"""Hz: a slower control law is a slip of the keyboard."""


def export(
    controller: str,
    file: str,
    *,
    vehicle: str | None = None,
    gravity: float | None = None,
    rate: float | None = None,
    name: str | None = None,
    single: bool = False,
) -> str:
    """Write a controller as a C file; returns a line on what was written and one on the delay that it bears.

    Args:
        controller: a preset, a law, LAW_tuned or a file of gains, built for the vehicle; or a scenario, whose
            controller is taken as it flies.
        file: to write.
        vehicle: what the controller believes in; a scenario brings its own.
        gravity: m/s^2, believed; 9.81 if left out, a scenario brings its own.
        rate: Hz, of the control; 200, or the scenario's, if left out.
        name: begins the names in the file; the controller's if left out.
        single: float in place of double.

    Raises:
        ValueError, OSError: one line.
    """
    written = output_file(file, "--out")
    held = None if rate is None else number(rate, "--rate", low=0.0, strict=True)
    if held is not None and not SLOWEST <= held <= HIGHEST_RATE:
        raise ValueError(f"--rate = {rate!r}: must be from {SLOWEST:g} to {HIGHEST_RATE} Hz")
    note, estimator, flown = "", None, None
    if is_named(controller) or _is_of_gains(controller):
        if vehicle is None:
            raise ValueError(f"--vehicle: is missing; controller {controller!r} must know the vehicle it flies")
        felt = 9.81 if gravity is None else number(gravity, "--gravity", low=0.0)
        model = Model(vehicle=load_vehicle(vehicle), gravity=felt)
        chosen, title = _built(controller, model, 1.0 / (held or RATE)), _title(controller)
    else:
        _require_known(controller)
        for option, value in (("--vehicle", vehicle), ("--gravity", gravity)):
            if value is not None:
                raise ValueError(f"{option} = {value!r}: must be left out, scenario {controller!r} brings its own")
        planned = load_scenario(controller)
        chosen, title = planned.controller, planned.name
        estimator = planned.estimator if isinstance(planned.estimator, ErrorStateFilter) else None
        if len(without_law(planned.changes)) < len(planned.changes):
            note = f"; the law as {controller} begins, without its changes in flight"
        flown = planned if held in (None, float(planned.rates.control)) else None
        held = held or float(planned.rates.control)
    say_if_many(title, chosen.par.model.vehicle.n)
    period = 1.0 / (held or RATE)
    generator = ", ".join([f"skyarm {__version__}", *(f"{name} {each}" for name, each in identities().items())])
    exported = export_c(
        chosen,
        name=name or _identifier(title),
        period=period,
        single=single,
        generator=generator,
        estimator=estimator,
    )
    write_atomically(written, exported.text.encode("ascii"))
    said, facts = _margin(chosen, flown, held or RATE)
    give(
        facts,
        file=written,
        function=f"{exported.name}_step",
        law=chosen.name,
        vehicle=chosen.par.model.vehicle.name,
        number="float" if single else "double",
        operations=exported.operations,
        parameters=len(exported.parameters),
        rate_hz=1.0 / period,
    )
    return (
        f"{written}: {exported.name}_step, {chosen.name} for {chosen.par.model.vehicle.name}, "
        f"{exported.operations} operations in {'float' if single else 'double'}, {len(exported.parameters)} parameters"
        f"{note}\n{said}"
    )


def _margin(chosen: Controller, flown: Scenario | None, rate: float) -> tuple[str, dict[str, Any]]:
    """What is said of the delay that a controller bears: in its scenario, else in a hover of the vehicle it knows."""
    joints = chosen.par.model.vehicle.n
    reason = ""
    if rate != round(rate) or rate > FASTEST_HOVER:
        reason = f"a rate of {rate:g} Hz; it is asked for at whole numbers up to {FASTEST_HOVER}"
    elif joints > MOST_JOINTS:
        reason = f"{joints} joints; 'skyarm check SCENARIO' takes its time for it"
    if reason:
        return f"delay margin: not known: {reason}", plain_margin(None)
    if flown is None:
        try:
            flown = hover_of(chosen, round(rate))
        except ValueError as error:
            return f"delay margin: not known: {error}", plain_margin(None)
    return margin_said(flown, chosen.name)


def _built(name: str, model: Model, period: float) -> Controller:
    try:
        return make_named_or_tuned(name, model, {"control_period": period})
    except AllocationError as error:
        raise ValueError(f"--vehicle = {model.vehicle.name!r}: {error}") from None


def _is_of_gains(controller: str) -> bool:
    """Whether it is the path of a file of gains."""
    path = Path(controller)
    if path.suffix != ".toml" or unreadable(path):
        return False
    try:
        return kind_of(read_toml(path.read_bytes())) == "gains"
    except (OSError, ValueError):
        return False


def _title(controller: str) -> str:
    return Path(controller).stem if _is_of_gains(controller) else law_of_file_name(controller)


def _require_known(controller: str) -> None:
    if controller not in list_scenarios() and Path(controller).suffix != ".toml":
        raise ValueError(
            f"controller = {shown(controller)}: {meant(controller)}must be {choices(controller)}, "
            f"or a scenario ({', '.join(list_scenarios())}) or a scenario's .toml file"
        )
    if controller not in list_scenarios() and not Path(controller).is_file():
        raise ValueError(f"controller = {shown(controller)}: no such file; must be one of a scenario or of gains")


def _identifier(title: str) -> str:
    text = re.sub(r"[^A-Za-z0-9_]", "_", title)
    return text if text[0].isalpha() else f"law_{text}"
