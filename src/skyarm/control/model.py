"""Model, gains and constants of a controller."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Any, ClassVar, Self

from skyarm.algebra import Scalar, Vec3
from skyarm.control.controller import ControllerError
from skyarm.dynamics.actuators import Mixer
from skyarm.records.field_rules import checked
from skyarm.records.files import shown
from skyarm.records.immutable import field_if_any, immutable
from skyarm.records.leaves import field_names
from skyarm.records.path_names import Names, field_paths
from skyarm.records.units import Unit, nonnegative
from skyarm.records.words import Word
from skyarm.vehicle import Vehicle, VehicleError


@immutable
@checked("model", VehicleError)
class Model:
    """Model of a controller: its nominal vehicle and gravity (m/s^2), which may differ
    from the simulated plant.
    """

    vehicle: Vehicle
    gravity: Annotated[
        Scalar,
        nonnegative(
            "m/s^2",
            "gravitational acceleration of the controller's model, downwards",
            usual=25.0,
        ),
    ] = 9.81

    def path_names(self) -> Names:
        """Names in parameter paths: the model's fields, and the loads carried by the
        vehicle.
        """
        return field_paths(self) | {"payload": self.vehicle.load_names()}


@immutable
@checked("controller.gains", ControllerError)
class GeometricGains:
    """Gains of the geometric controller, per axis.

    Attributes:
        position: Kp, N/m. velocity: Kv, N s/m.
        attitude: KR, N m/rad. rate: Kw, N m s/rad.
    """

    position: Annotated[
        Vec3,
        nonnegative(
            "N/m",
            "Kp, force per position error, along each axis",
            effect=(
                "higher values correct position errors faster and need faster attitude"
                " loops"
            ),
        ),
    ]
    velocity: Annotated[
        Vec3,
        nonnegative(
            "N s/m",
            "Kv, force per velocity error, along each axis",
            effect=(
                "higher values damp the position more and amplify noise of the velocity"
            ),
        ),
    ]
    attitude: Annotated[
        Vec3,
        nonnegative(
            "N m/rad",
            "KR, torque per attitude error, about each body axis",
            effect="higher values turn the base faster; motor lag and delay limit them",
        ),
    ]
    rate: Annotated[
        Vec3,
        nonnegative(
            "N m s/rad",
            "Kw, torque per body rate error, about each body axis",
            effect=(
                "higher values damp the attitude more and amplify noise of the"
                " gyroscope"
            ),
        ),
    ]


@immutable
@checked("controller.joint_gains", ControllerError)
class JointGains:
    """Gains per joint: on torque (N m/rad, N m s/rad) or on acceleration (1/s^2, 1/s),
    depending on the law.
    """

    stiffness: Annotated[
        tuple[float, ...],
        nonnegative(
            "1/s^2",
            "desired acceleration of each joint per error of its position",
            effect=(
                "higher values hold the joints more tightly, amplify noise and tolerate"
                " less delay"
            ),
        ),
    ]
    damping: Annotated[
        tuple[float, ...],
        nonnegative(
            "1/s",
            "desired acceleration of each joint per error of its rate",
            effect="higher values damp the joints more and amplify noise of the rates",
        ),
    ]


TORQUE_GAINS: Mapping[str, Unit] = {
    "stiffness": Unit("N m/rad or N/m", "effort per error of the joint"),
    "damping": Unit("N m s/rad or N s/m", "effort per error of the joint's rate"),
}
"""Units of JointGains for a law whose joint gains act on torque."""


@immutable
@checked("controller.terms", ControllerError)
class Terms:
    """Terms of the computed torque law that an ablation can disable.

    Attributes:
        coriolis: velocity products C(q, qd) qd. Body coordinates have other velocity
            products than Euler rates: the body form without them takes rates for zero;
            the Euler form leaves the paper's C qd out, while (95) stays.
        coupling: inertial blocks between base and arm in body coordinates, M_t_eta and
            M_r_eta: the base's acceleration does not act on the joints and the joints'
            does not on the base. Weight and velocity products stay.
        full_gravity: gravity by the true attitude; False evaluates the joints' weight
            at R = 1 (the paper's eq. 78-79) and leaves the weight's torque on the base
            out.
        feedforward: accelerations of the reference.
    """

    coriolis: bool = True
    coupling: bool = True
    full_gravity: bool = True
    feedforward: bool = True

    @classmethod
    def from_table(cls, names: object, where: str) -> Self:
        """Terms of the computed torque law, all enabled except those in a list of
        names.
        """
        allowed = field_names(cls) or ()
        if not isinstance(names, list) or any(name not in allowed for name in names):
            raise ValueError(
                f"{where} = {shown(names)}: must be a list of {', '.join(allowed)}"
            )
        return cls(**dict.fromkeys(names, False))


MeasurementAge = Annotated[
    int, Unit("control periods", "known age of the measurement", low=0, high=100)
]
"""Known age of the measurement, as constants of several laws declare it."""


@immutable
class Parameters:
    """Constants of a law: model, gains, mixer and options.

    Attributes:
        rate_error: see :func:`skyarm.control.blocks.geometric.rate_error`.
        terms: ablation of the computed torque; without ``full_gravity`` it is the
            paper's text to the letter.
        friction_compensation: for each joint, the share of its model's friction that
            its torque compensates, behind the inertia matrix; () compensates none.
        rate_weights: for each joint, weight of its desired rate in the difference of
            rates (set-point weighting of the derivative, Astrom, Hagglund 2006, section
            3.4); () is 1.
        euler: the computed torque on the paper's Euler angles, which are undefined at a
            pitch of 90 degrees.
    """

    model: Model
    gains: GeometricGains
    joint_gains: JointGains
    mixer: Mixer
    rate_error: str = "rotors_sim"
    terms: Terms = Terms()
    friction_compensation: Annotated[
        tuple[float, ...],
        nonnegative(
            "",
            "fraction of the modelled friction that the torque of each joint"
            " compensates; empty: none",
            effect=(
                "higher values remove more of the friction; above 1 the compensation"
                " drives the joint itself"
            ),
        ),
    ] = ()
    rate_weights: Annotated[
        tuple[float, ...],
        nonnegative(
            "",
            "set-point weight of each joint's desired rate; empty: 1",
            effect="lower values overshoot less and track a moving reference later",
        ),
    ] = ()
    euler: bool = field_if_any(default=False)


@immutable
class Options:
    """Options that several control laws share, with their keys in a file.

    Attributes:
        gains, joint_gains: None for those that fit the model.
        mixer_policy: policy of the :class:`skyarm.dynamics.actuators.Mixer` at rotor
            limits.
        terms: enabled terms of the computed torque.
    """

    gains: GeometricGains | None = None
    joint_gains: JointGains | None = None
    mixer_policy: Annotated[str, Word("mixer")] = "clip"
    terms: Annotated[Terms, Word("without")] = Terms()


@immutable
class LayerParameters:
    """Constants of a law inside a layer (safety, tilting rotors, servos and thrust
    tables).

    Attributes:
        model, mixer: model and mixer of everything inside, passed to it at each call.
        inner: constants of the law, without these two.
    """

    model: Model
    mixer: Mixer
    inner: Any

    turns_rotors: ClassVar[bool] = False
    """True if the layer commands the angles of tilting rotors."""

    @classmethod
    def around(cls, par: Any, **constants: Any) -> Self:
        """Constants of a layer wrapped around the constants of a law."""
        return cls(
            # one model and mixer at the outermost layer, so that a change reaches all
            # of them
            **{"mixer": par.mixer, "inner": replace(par, model=None, mixer=None)}
            | constants
        )

    @property
    def inner_model(self) -> Model:
        """Vehicle model for the law inside the layer."""
        return self.model

    @property
    def own(self) -> Any:
        """Constants of the law inside a layer, with the law's model and mixer filled
        in.
        """
        return replace(self.inner, model=self.inner_model, mixer=self.mixer)
