"""Generation of a law's maker function, with options from the declared constants and
default gains for a model.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, fields
from types import MappingProxyType
from typing import Any

from skyarm.algebra import Vec3
from skyarm.control.blocks.geometric import RATE_ERRORS
from skyarm.control.controller import Controller, ControllerError, Law, LawOptions
from skyarm.control.model import GeometricGains, JointGains, Model, Options, Parameters
from skyarm.dynamics import mass_matrix_at_rest
from skyarm.dynamics.actuators import Mixer, make_mixer
from skyarm.dynamics.actuators.mixer import POLICIES
from skyarm.records import coerce
from skyarm.records.coerce import RecordError
from skyarm.records.field_rules import defaults as usual
from skyarm.records.field_rules import rules
from skyarm.records.files import errors_as, shown
from skyarm.records.leaves import Tree

# gains that the paper flies over the mass (kg) and base inertia (kg m^2) that its
# vehicle has: another vehicle then gets the same accelerations per error. The mass is
# that of the Hummingbird with the paper's arm
RATIO_POSITION, RATIO_VELOCITY = 4.0 / 0.806, 2.2 / 0.806

# over the moments of inertia (kg m^2) of its base
RATIO_ATTITUDE = (0.7 / 0.007, 0.7 / 0.007, 0.035 / 0.012)
RATIO_RATE = (
    0.1 / 0.007,
    0.1 / 0.007,
    0.025 / 0.012,
)

ACCELERATION_GAINS = (150.0, 17.0)
"""Default joint gains on acceleration (1/s^2 and 1/s): 12.2 rad/s as joint 2 of Barakou
et al. 2026, damping 0.7."""


def default_gains(model: Model) -> GeometricGains:
    """RotorS's geometric gains of the Hummingbird, scaled to another vehicle's mass and
    base inertia.
    """
    mass, J = model.vehicle.mass, model.vehicle.base.inertia
    moments = (J.xx, J.yy, J.zz)
    return GeometricGains(
        position=Vec3(*(RATIO_POSITION * mass,) * 3),
        velocity=Vec3(*(RATIO_VELOCITY * mass,) * 3),
        attitude=Vec3(*(r * j for r, j in zip(RATIO_ATTITUDE, moments, strict=True))),
        rate=Vec3(*(r * j for r, j in zip(RATIO_RATE, moments, strict=True))),
    )


def default_joint_gains(model: Model, *, torque: bool = False) -> JointGains:
    """Default joint gains on acceleration, or with ``torque`` on torque, scaled by each
    joint's inertia.

    Friction is not in the laws: a joint of inertia J with damping d lags by d rate / (J
    stiffness), which is large on a light link behind a real gear. Give such joints
    their own gains.
    """
    n = model.vehicle.n
    own: tuple[Any, ...] = (1.0,) * n
    if torque:
        M = mass_matrix_at_rest(model.vehicle)
        # torque over inertia is acceleration: joints of any inertia then answer alike
        own = tuple(M[6 + i][6 + i] for i in range(n))
    stiffness, damping = (tuple(gain * j for j in own) for gain in ACCELERATION_GAINS)
    return JointGains(stiffness=stiffness, damping=damping)


def fitting_mixer(model: Model, policy: str) -> Mixer:
    """Control allocation for a model's rotors, which treats speed limits by ``policy``,
    such as clip or priority.

    Raises:
        ControllerError: unknown policy.
        AllocationError: the model's rotors do not span torque and thrust.
    """
    if policy not in POLICIES:
        raise ControllerError(
            f"controller.mixer = {shown(policy)}: must be one of {', '.join(POLICIES)}"
        )
    return make_mixer(model.vehicle, policy)


Reader = Callable[[Model, Any], Any]
"""Function (model, value of an option) -> constant of the control law."""


def law_maker(
    name: str,
    law: Law,
    kind: type[Parameters] = Parameters,
    *,
    shared: Sequence[str] = (),
    readers: Mapping[str, tuple[Any, Reader]] | None = None,
    constants: Callable[[Model], LawOptions] | None = None,
    memory: Callable[[Any], Tree] | None = None,
    torque_gains: bool = False,
    rate_error: str = "corrected",
    bounds: Callable[[Any], LawOptions] | None = None,
    **of_controller: Any,
) -> Callable[..., Controller]:
    """Make the function (model, **options) -> Controller of a control law.

    Its options are ``gains`` of the base and ``joint_gains`` (defaults that fit the
    model), ``mixer_policy`` (:class:`skyarm.dynamics.actuators.Mixer`), and the fields
    with a default of the law's constants, each checked by its annotation. None stands
    for the default.

    Args:
        name: name of the law.
        law: step function.
        kind: class of its constants.
        shared: options among the fields of :class:`Parameters`.
        readers: default and reader of each option that is written otherwise than
            stored.
        constants: function from the model to further constants.
        memory: function from the constants to the initial internal state.
        torque_gains: joint gains act on torque.
        rate_error: form of the body rate error where that is no option.
        bounds: further fields of :class:`Controller` that follow from the constants,
            such as ``margin``.
        of_controller: further fields of :class:`Controller`.
    """
    readers = readers or {}
    inherited = {field.name for field in fields(Parameters)}
    defaults: dict[str, Any] = {
        name: usual(Options)[name] for name in ("gains", "joint_gains", "mixer_policy")
    }
    for field in fields(kind):
        if field.name in shared or (
            field.name not in inherited and field.default is not MISSING
        ):
            defaults[field.name] = field.default
    defaults |= {option: default for option, (default, _) in readers.items()}
    keyword = inspect.Parameter.KEYWORD_ONLY
    signature = inspect.Signature(
        [inspect.Parameter("model", inspect.Parameter.POSITIONAL_OR_KEYWORD)]
        + [
            inspect.Parameter(option, keyword, default=default)
            for option, default in defaults.items()
        ]
    )

    def make(model: Model, **options: Any) -> Controller:
        # an unknown option is the TypeError that a written signature would raise
        signature.bind(model, **options)
        chosen = defaults | {
            option: value for option, value in options.items() if value is not None
        }
        mixer = fitting_mixer(model, chosen.pop("mixer_policy"))
        if chosen["gains"] is None:
            chosen["gains"] = default_gains(model)
        if chosen["joint_gains"] is None:
            chosen["joint_gains"] = default_joint_gains(model, torque=torque_gains)
        values = {"rate_error": rate_error, **(constants(model) if constants else {})}
        for option, value in chosen.items():
            values[option] = checked_option(kind, option, value, model, readers)
        _require_fitting(values, model.vehicle.n)
        par = kind(model=model, mixer=mixer, **values)
        own = {**of_controller, **(bounds(par) if bounds else {})}
        return Controller(
            name=name, law=law, par=par, memory=memory(par) if memory else (), **own
        )

    # the catalogue reads options and defaults from the signature, as of a written maker
    make.__name__, make.__doc__ = f"make_{name}", f"The law {name!r} for a model."
    make.__signature__ = signature  # type: ignore[attr-defined]
    make.constants = kind  # type: ignore[attr-defined]
    return make


def checked_option(
    kind: type,
    option: str,
    value: Any,
    model: Model,
    readers: Mapping[str, tuple[Any, Reader]] = MappingProxyType({}),
) -> Any:
    """Option value validated and converted to the type of the law's constant.

    Raises:
        ControllerError: one line with field, value and what is allowed.
    """
    with errors_as(ControllerError, of=RecordError):
        if option in readers:
            return readers[option][1](model, value)
        rule = rules(kind).get(option)
        return value if rule is None else rule(f"controller.{option}", value)


def option_numbers(option: str, value: object, count: int) -> tuple[Any, ...]:
    """Option value converted to a tuple of ``count`` numbers.

    Raises:
        ControllerError: one line.
    """
    at = f"controller.{option}"
    with errors_as(ControllerError, of=RecordError):
        rows = coerce.items(
            at, value, (count,), f"must be {count} number{'s' * (count > 1)}"
        )
        return tuple(coerce.number(f"{at}[{i}]", each) for i, each in enumerate(rows))


def _require_fitting(values: LawOptions, joints: int) -> None:
    """Reject options per joint with a wrong number of values, and an unknown value of
    the option ``rate_error``.
    """
    gains = values["joint_gains"]
    for field, row in (("stiffness", gains.stiffness), ("damping", gains.damping)):
        if len(row) != joints:
            raise ControllerError(
                f"controller.joint_gains.{field}: {len(row)} values, must be {joints}"
                " (one per joint)"
            )
    for option in ("friction_compensation", "rate_weights"):
        # an option that a law does not have counts as empty, which is left out, too
        if len(values.get(option, ())) not in (0, joints):
            said = f"controller.{option} = {shown(values[option])}"
            raise ControllerError(
                f"{said}: must be {joints} numbers, one for each joint"
            )
    if values["rate_error"] not in RATE_ERRORS:
        said = f"controller.rate_error = {shown(values['rate_error'])}"
        raise ControllerError(f"{said}: must be one of {', '.join(RATE_ERRORS)}")
