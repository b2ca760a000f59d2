"""Controllers of a scenario file: [controller] states a preset, a law with options, or
a file of gains.

A file of gains has a law by its words, and numbers in place of those of its constants.
``skyarm tune`` writes such files, and anyone may. A scenario names one by
``[controller] tuned = "FILE.toml"``, a command line by ``--laws FILE.toml``::

    schema = 1
    [law]                 the words of a scenario's [controller]: preset, or law and its
                          options
    [gains]               "gains.position" = 4.2, or a list: all numbers below a path of
                          the law's constants
    [about]               where they come from; nothing of it is flown

A user's law, FILE.py:make, must have been loaded: ``--plugin FILE.py`` does so; no file
that is read runs code.
"""

from __future__ import annotations

import dataclasses
import math
import os
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeGuard, get_args

from skyarm.control.actuator_layer import (
    ActuatorParameters,
    commands_actuators,
    has_tables,
    plain_model,
    with_actuators,
)
from skyarm.control.catalogue import (
    AUTOPILOTS,
    LAWS,
    OWN,
    PRESETS,
    entry_of,
    every_name,
    law_of,
    make_controller,
    make_named,
    make_tuned,
    no_option,
    preset,
    suitable_options,
    tuned_factors,
)
from skyarm.control.controller import Controller, ControllerError, autopilot_of
from skyarm.control.model import Model, Options
from skyarm.dynamics.actuators import AllocationError
from skyarm.records.files import (
    Fields,
    did_you_mean,
    errors_as,
    must_be_one_of,
    number,
    read_toml,
    require_file,
    shown,
)
from skyarm.records.files.names import require_kind
from skyarm.records.identity import identity
from skyarm.records.leaves import (
    Place,
    is_leaf,
    is_record,
    is_record_class,
    parts,
    replace_at,
    walk,
)
from skyarm.records.read_table import value_from
from skyarm.records.registry.plugins import is_law_of_file, register_loaded_law
from skyarm.records.registry.registrations import LOADED_BY
from skyarm.records.units import NUMBER, Unit, declared_units, parameters_of
from skyarm.records.words import words_of_fields
from skyarm.scenario.scenario_record import Delays, Rates, Scenario
from skyarm.sensing.estimate.estimator import PASS_THROUGH, Estimator
from skyarm.vehicle import Vehicle


def loop_facts(
    rates: Rates, delays: Delays, estimator: Estimator = PASS_THROUGH
) -> dict[str, float]:
    """Timing data for building a control law: control period, reference period and
    measurement delay, s.

    An estimator that does not read the full state gives the law the present, whatever
    the age of that.
    """
    age = delays.measurement if estimator.reads_state else 0.0
    return _timing(1.0 / rates.control, 1.0 / rates.reference, age)


def _timing(
    control_period: float, reference_period: float, delay: float
) -> dict[str, float]:
    periods = {"control_period": control_period, "reference_period": reference_period}
    return periods | {
        "delay": delay,
        "age": delay,
        "delay_periods": round(delay / control_period),
    }


def controller_from(
    fields: Fields,
    model: Model,
    replaced: str | None,
    timing: Mapping[str, float],
    folder: Path = Path(),
) -> Controller:
    """Build the controller that a [controller] table describes, with its safety and
    actuator layers.

    Args:
        fields: the table.
        model: law's model.
        replaced: name of :mod:`skyarm.control.catalogue`, or a file of gains, in place
            of the table's law.
        timing: timing of the control loop (:func:`skyarm.control.catalogue.preset`).
        folder: folder of the table's own file of gains.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    safety = fields.take("safety", False)
    servos = fields.flag("servos", bool(model.vehicle.drives))
    plain = plain_model(model)
    with errors_as(
        ValueError, f"model.vehicle = {model.vehicle.name!r}: ", AllocationError
    ):
        if replaced is not None:
            controller = make_named_or_tuned(replaced, plain, timing)
        elif isinstance(fields.table.get("tuned"), str):
            names = f"the file of {fields.at('tuned')} names the law"
            _require_only(
                fields,
                "tuned",
                f"{names}; next to it only safety and servos are allowed",
            )
            controller = controller_of_file(
                fields.take("tuned"), folder, plain, timing, fields.at("tuned")
            )
        else:
            controller = by_words(fields, plain, timing)
    with errors_as(ValueError, "controller.", ControllerError):
        return on_actuators(
            _with_safety(controller, safety), model, timing["control_period"], servos
        )


def require_servos_said(fields: Fields, carrier: Vehicle, model: Model) -> None:
    """Raise an error if plant joints have servos, the model has none, and [controller]
    does not state ``servos``.

    Raises:
        ValueError: one line: torques would reach the servos as angles.
    """
    if carrier.drives and not model.vehicle.drives and "servos" not in fields.table:
        raise ValueError(
            f"{fields.at('servos')}: is missing; plant.vehicle = {carrier.name!r} has"
            f" servos and model.vehicle = {model.vehicle.name!r} none: give it"
            " [model.drives.JOINT], or say false for a law of setpoints"
        )


def _with_safety(controller: Controller, safety: object) -> Controller:
    """Wrap a controller in the safety layer that [controller] safety requests: false,
    true, or a table of limits.
    """
    if safety is False:
        return controller
    from skyarm.control.safety import with_safety_layer

    if safety is True:
        return with_safety_layer(controller)
    if not isinstance(safety, dict):
        raise ValueError(
            f"controller.safety = {shown(safety)}: must be true, false or a table of"
            " limits"
        )
    table = Fields(safety, "controller.safety")
    stow = table.numbers("stow") if "stow" in safety else None
    return with_safety_layer(
        controller,
        {name: value for name, value in safety.items() if name != "stow"},
        stow=stow,
    )


def controller_by_name(scenario: Scenario, name: str) -> Controller:
    """Build a controller by name for a scenario, with the safety and actuator layers of
    its present controller.

    The safety layer stays, and so does that of the actuators: a law of torques takes
    the place of a law of torques.

    Raises:
        ControllerError: unknown name, or a controller that does not fit the model.
        AllocationError: the model's rotors do not span torque and thrust.
    """
    own = scenario.agent
    before = own.controller.par
    facts = loop_facts(scenario.rates, own.delays, own.estimator)
    made = make_named_or_tuned(name, plain_model(before.model), facts)
    if not isinstance(before, ActuatorParameters):
        return _with_safety_of(before, made, scenario)
    servos = bool(own.controller.memory.drives)
    safe = _with_safety_of(before.own, made, scenario)
    return on_actuators(safe, before.model, scenario.rates.period, servos)


def on_actuators(
    made: Controller, model: Model, control_period: float, servos: bool
) -> Controller:
    """Add the actuator layer (joint servos, thrust tables of the model) to a
    controller; unchanged if it needs none.
    """
    needed = (servos or has_tables(model)) and not commands_actuators(made)
    return (
        with_actuators(made, model, control_period, servos=servos) if needed else made
    )


def _with_safety_of(before: Any, made: Controller, scenario: Scenario) -> Controller:
    """Wrap a new controller in the safety layer of the controller that it replaces, if
    there is such a layer.
    """
    # a layer that turns rotors lies around the safety layer
    if getattr(before, "turns_rotors", False):
        before = before.own
    from skyarm.control.safety.safety_layer import SafetyParameters

    if not isinstance(before, SafetyParameters):
        return made
    from skyarm.control.safety import with_safety_layer
    from skyarm.control.safety.limits import usual_joint_errors

    # limits that were measured on the law before are measured on the new one
    measured = [name for _, name in before.measured_limits]
    limits = {
        field: value
        for field, value in parts(before.limits).items()
        if field not in measured
    }
    usual = usual_joint_errors(
        before.model.vehicle, keeps_tip=scenario.agent.controller.keeps_tip
    )
    if limits["trusted_joint_error"] == usual:
        # usual for the law before; one that keeps the tip loses its joints by more, and
        # one that tracks them by less
        del limits["trusted_joint_error"]
    return with_safety_layer(made, limits, stow=tuple(map(float, before.recovery.stow)))


class OwnOptionsWarning(UserWarning):
    """Warning about a scenario's own law that is named in place of it and so flies
    without its options.
    """


def warn_of_own_options(own: Scenario, flown: Scenario, name: str) -> None:
    """Warn if a law that is named is a scenario's own, without the options that the
    scenario gives it.

    Args:
        own: scenario under its own laws.
        flown: scenario under the named law.
        name: the law's name; a file of gains has options of its own.
    """
    if not is_gains_file(name) and any(
        _loses_options(own.of(each), flown.of(each).agent.controller, name)
        for each in own.agents
    ):
        line = f"flies {name} with its defaults, not the options of the scenario"
        warnings.warn(
            f"{own.name}: {line}: write {OWN!r}", OwnOptionsWarning, stacklevel=2
        )


def _loses_options(scenario: Scenario, made: Controller, name: str) -> bool:
    """True if a named controller is that of a scenario but for options.

    The scenario has one vehicle, and its own controller is none that has a name.
    """
    own = scenario.agent.controller
    return (
        own.name == made.name
        and identity(own) != identity(made)
        and not any(
            _is_made_by(scenario, other)
            for other in every_name()
            if law_of(other) == law_of(name)
        )
    )


def _is_made_by(scenario: Scenario, name: str) -> bool:
    """True if a name alone makes the controller of a scenario of one vehicle."""
    try:
        made = controller_by_name(scenario, name)
    except ValueError:  # a preset of another vehicle
        return False
    return identity(made) == identity(scenario.agent.controller)


def under_law(scenario: Scenario, name: str) -> Scenario:
    """Scenario with the law of each vehicle replaced by the preset, law or gains file
    of a given name; unchanged for "own".

    Raises:
        ControllerError, AllocationError: as :func:`controller_by_name`.
    """
    if name == OWN:
        return scenario
    made = [controller_by_name(scenario.of(each), name) for each in scenario.agents]
    flown = scenario.under(*made)
    warn_of_own_options(scenario, flown, name)
    return flown


PYTHON_ONLY = ("network", "program")
"""Options of laws that a file cannot contain."""

LAYERS = ("safety", "servos")
"""Keys of [controller] that select layers around any law."""


def option_words(law: str) -> dict[str, str]:
    """Keys of a [controller] table for the options of a control law, each with the
    option that it states.

    An option that its maker does not declare is called, and read, as that of many laws.
    """
    entry = entry_of(law)
    called = words_of_fields(Options) | words_of_fields(entry.function())
    return {
        called.get(option, option): option
        for option in entry.options()
        if option not in PYTHON_ONLY
    }


def law_words(law: str) -> tuple[str, ...]:
    """Keys that a [controller] table may have for a given control law."""
    return (
        *option_words(law),
        *(("tuned",) if law in tuned_factors() else ()),
        *LAYERS,
    )


def by_words(
    fields: Fields, model: Model, timing: Mapping[str, float], *, loaded: bool = False
) -> Controller:
    """Build the controller of a [controller] table from a preset's name, or from a
    law's name and its options.

    Args:
        fields: the table.
        model: law's model.
        timing: timing data of the loop.
        loaded: True if the law may be that of a file that is loaded already.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    if "autopilot" in fields.table:
        name = _require_name(fields, "autopilot", AUTOPILOTS)
        return _of_options("autopilot", name, fields, model, timing)
    if fields.table.get("preset") in (*PRESETS,) and "law" in fields.table:
        beside = (
            f"{fields.at('preset')} = {fields.table['preset']!r}: must be left out"
            " beside law"
        )
        raise ValueError(
            f"{beside} = {shown(fields.table['law'])}, or law beside it: a preset is a"
            " law with its gains"
        )
    if "law" not in fields.table:
        return preset(_preset_name(fields), model, timing)
    law = fields.take("law")
    if is_law_of_file(law) and not loaded:
        raise ValueError(
            f"{fields.at('law')} = {shown(law)}: must not be a file's; only --laws"
            " takes FILE.py:make"
        )
    hint = f"; it is a preset: preset = {law!r}" if law in (*PRESETS,) else ""
    name = _require_name(fields, "law", LAWS, hint)
    return _of_options("law", name, fields, model, timing)


def _require_name(
    fields: Fields, word: str, names: Mapping[str, object], hint: str = ""
) -> str:
    """Read a name from a key of a [controller] table; an unknown name raises an error
    that ends in ``hint``.
    """
    name = fields.take(word)
    if not isinstance(name, str) or name not in names:
        raise ValueError(
            f"{fields.at(word)} = {shown(name)}:"
            f" {must_be_one_of(names, name, 'skyarm show')}{hint}"
        )
    return name


def _of_options(
    word: str, law: str, fields: Fields, model: Model, timing: Mapping[str, float]
) -> Controller:
    """Build the controller of a law or an autopilot with the options that its
    [controller] table states.
    """
    best = fields.flag("tuned", False)
    keys = law_words(law)
    if word == "autopilot" and "program" in fields.table:
        variable = autopilot_of(make_controller(law, model)).variable
        raise ValueError(
            f"{fields.at('program')} = {shown(fields.table['program'])}: must be left"
            " out: no file names a program to start, the environment variable"
            f" {variable} does"
        )
    for other, value in fields.table.items():
        # "tuned = false" is what is so anyway, of any law
        if other not in (*keys, word) and (other, value) != ("tuned", False):
            raise ValueError(
                f"{fields.at(other)} = {shown(value)}: {no_option(law, keys, other)}"
            )
    options = suitable_options(law, timing)
    maker = entry_of(law).function()
    kinds = declared_units(Options) | declared_units(maker)
    usual = {name: each.default for name, each in parameters_of(maker).items()}
    for own, option in option_words(law).items():
        if own in fields.table:
            options[option] = _read(
                fields, own, usual.get(option), *kinds.get(option, (None, NUMBER))
            )
    if "age" in options and "delay" in fields.table and "age" not in fields.table:
        # a delay that is stated shorter than the loop's is the measurement's alone
        options["age"] = min(
            options["age"], number(fields.table["delay"], fields.at("delay"), low=0.0)
        )
    _require_clock(fields, timing)
    return (make_tuned if best else make_controller)(law, model, **options)


def _require_clock(fields: Fields, timing: Mapping[str, float]) -> None:
    """Raise an error if a table states a control period other than the loop's."""
    period = fields.table.get("control_period")
    if period is None:
        return
    at, ticking = fields.at("control_period"), timing["control_period"]
    # decimals of a file round one over the rate
    if not math.isclose(number(period, at), ticking, rel_tol=1e-6):
        raise ValueError(
            f"{at} = {period!r}: must be {ticking:g} s, as rates.control has it"
        )


def _preset_name(fields: Fields) -> str:
    """Name of the preset that a [controller] table states, after a check that no law
    options are given with it.
    """
    name: str | None = fields.take("preset", None)
    if name is None:
        raise ValueError(
            f"{fields.where}: must have a preset, as 'centroidal_tip', or a law;"
            " 'skyarm show' shows all"
        )
    if name in (*LAWS,) and name not in PRESETS:
        raise ValueError(
            f"{fields.at('preset')} = {name!r}: is no preset but a law: law = {name!r}"
        )
    _require_only(
        fields,
        "preset",
        "next to a preset only safety and servos are allowed, a law takes options",
    )
    return name


def _require_only(fields: Fields, word: str, allowed: str) -> None:
    """Raise an error if a [controller] table has other keys than the given one,
    ``safety`` and ``servos``.
    """
    for other, value in fields.table.items():
        # tuned = false states what holds without it
        if other not in (word, *LAYERS) and (other, value) != ("tuned", False):
            raise ValueError(
                f"{fields.at(other)} = {shown(value)}: must be left out: {allowed}"
            )


def _read(
    fields: Fields, word: str, usual: object, annotation: object, unit: Unit
) -> object:
    """Read one option of a control law from a [controller] table; an option that is a
    table becomes a dataclass.

    Numbers that the table does not state are those of the record that the option is
    where it is left out.
    """
    if is_record(usual) and not hasattr(usual, "from_table"):
        table = Fields(fields.take(word), fields.at(word))
        numbers = {
            name: table.number(name, each, low=0.0)
            for name, each in parts(usual).items()
        }
        table.done()
        return replace_at(usual, {(name,): each for name, each in numbers.items()})
    kinds = [*filter(is_record_class, (annotation, *get_args(annotation)))]
    return value_from(kinds[0], unit, fields, word) if kinds else fields.take(word)


SUFFIX = ".toml"


def is_gains_file(name: object) -> TypeGuard[str]:
    """True if a controller's name is the path of a gains file."""
    return isinstance(name, str) and name.endswith(SUFFIX)


def make_named_or_tuned(
    name: str, model: Model, timing: Mapping[str, float]
) -> Controller:
    """Controller by its name in the catalogue or by the path of a gains file.

    Raises:
        ValueError: one line.
    """
    if is_gains_file(name):
        return controller_of_file(name, Path(), model, timing, "controller")
    return make_named(name, model, timing)


def load_controller(
    file: str | Path,
    model: Model,
    *,
    delay: float = 0.0,
    control_period: float = 0.005,
    reference_period: float = 0.02,
) -> Controller:
    """Load a control law from a gains file written by ``skyarm tune``, for a given
    model.

    Args:
        file: path, .toml.
        model: law's model.
        delay: known age of the measurement, s; for laws with such an option, as all
            that follow.
        control_period: s.
        reference_period: between published samples, s.

    Raises:
        ValueError: one line: file, field, value, what is allowed.
    """
    if not isinstance(model, Model):
        raise ValueError(
            f"model = {shown(model)}: must be a Model of vehicle and gravity"
        )
    late = number(delay, "delay", low=0.0)
    ticking = number(control_period, "control_period", low=0.0, strict=True)
    published = number(reference_period, "reference_period", low=0.0, strict=True)
    return controller_of_file(
        os.fspath(file), Path(), model, _timing(ticking, published, late), "file"
    )


def controller_of_file(
    name: object, folder: Path, model: Model, timing: Mapping[str, float], field: str
) -> Controller:
    """Read a controller from a gains file (TOML) that a field of a scenario file names.

    Args:
        name: path of the file.
        folder: folder where the path starts.
        model: law's model.
        timing: timing of the control loop.
        field: field that names the file, for messages.

    Raises:
        ValueError: one line: file, field, value, what is allowed.
    """
    if not is_gains_file(name):
        raise ValueError(
            f"{field} = {shown(name)}: must be true, false, or a file that 'skyarm"
            " tune' wrote (.toml)"
        )
    path = folder / name
    require_file(path, f"{field} = {shown(path)}")
    try:
        document = read_toml(path.read_bytes())
        require_kind(document, "gains")
        return _controller(Fields(document, ""), model, timing)
    except OSError as error:
        raise ValueError(
            f"{field} = {shown(path)}: must be readable ({error.strerror})"
        ) from None
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _controller(top: Fields, model: Model, timing: Mapping[str, float]) -> Controller:
    top.require_schema()
    stated = Fields(top.take("law"), "law")
    gains = top.take("gains", {})
    top.take("about", None)
    top.done()
    tuned, law = stated.table.get("tuned"), stated.table.get("law")
    if isinstance(tuned, str):
        raise ValueError(
            f"law.tuned = {shown(tuned)}: must be left out: one file does not name"
            " another"
        )
    if isinstance(law, str) and is_law_of_file(law) and not register_loaded_law(law):
        raise ValueError(
            f"law.law = {shown(law)}: must be loaded:"
            f" {LOADED_BY.format(law.rpartition(':')[0])}"
        )
    return with_gains(by_words(stated, model, timing, loaded=True), gains, "gains")


def with_gains(controller: Controller, gains: object, where: str) -> Controller:
    """Controller with some constants replaced, each given by its parameter path such as
    ``gains.position``.

    Raises:
        ValueError: a path that the constants do not have, or numbers that do not fit
            it: one line.
    """
    if not isinstance(gains, Mapping):
        raise ValueError(
            f"{where} = {shown(gains)}: must be a table of paths and numbers"
        )
    numbers: dict[Place, float] = {}
    for path, value in gains.items():
        numbers |= _numbers(controller, path, value, f"{where}.{path!r}")
    return (
        dataclasses.replace(controller, par=replace_at(controller.par, numbers))
        if numbers
        else controller
    )


def _numbers(
    controller: Controller, path: str, value: object, field: str
) -> dict[Place, float]:
    record: object = controller.par
    place = tuple(path.split("."))
    for i, name in enumerate(place):
        there = {
            each: content
            for each, content in parts(record).items()
            # the model is the scenario's, and the mixer follows from it
            if each not in ("model", "mixer")
        }
        if name not in there:
            at = ".".join(place[:i])
            has = f"{at or 'the constants'} of {controller.name!r} " + (
                f"have {', '.join(there)}" if there else "end"
            )
            raise ValueError(
                f"{field}: {did_you_mean(name, there)}must be a path of the law's"
                f" constants; {has}"
            )
        record = there[name]
    leaves = [at for at, each in walk(record, place) if is_leaf(each)]
    given = list(value) if isinstance(value, list) else [value] * len(leaves)
    if not leaves or len(given) != len(leaves):
        raise ValueError(
            f"{field} = {shown(value)}: must be one number, or a list of {len(leaves)}"
        )
    return {
        at: number(each, field, low=0.0) for at, each in zip(leaves, given, strict=True)
    }
