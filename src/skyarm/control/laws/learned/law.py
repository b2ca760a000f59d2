"""Computed torque of Barakou et al. 2026 with a learned compensator, in the style of Wu
2024.

Law: a network of two hidden layers of 32 tanh estimates, from motion, errors and a
short history of velocities and commands, the force and torque at the base and the
torques at the joints that the model leaves out. Its filtered answer is taken off the
wanted force before the thrust is aimed, and off the inverse dynamics.

Assumed, since the equations of Wu 2024 were not at hand: the network replaces a
disturbance observer around a computed torque law; its inputs and size; supervised
training on simulated flights, no adaptation in flight; one filter of 15 rad/s per
velocity and command stands for the history; the answer is limited to what training has
seen and filtered.

Tuning: ``answer`` (rad/s), the paper's gains. The shipped weights are those of the
Hummingbird with the two-joint arm; ``examples/learned_compensator/train.py`` makes them
again.

Source: Wu et al. 2024 (idea only); base law Barakou et al. 2026, eq. (82)-(96).
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from skyarm.algebra import E_Z, Motion, Scalar, Scalars, Vec3, differences
from skyarm.algebra.scalars import clip, divide, mul, sub, tanh, total, where
from skyarm.control.blocks.common import (
    coupled_forces,
    make_command,
    no_command,
    turn_towards,
    wanted_specific_force,
)
from skyarm.control.blocks.filters import low_pass
from skyarm.control.blocks.prediction import calm_wrench
from skyarm.control.blocks.select import choose_each
from skyarm.control.controller import ControllerError
from skyarm.control.law_maker import law_maker
from skyarm.control.laws.paper import joint_accelerations
from skyarm.control.model import Model, Parameters
from skyarm.dynamics.actuators import Command
from skyarm.records.coerce import concrete
from skyarm.records.files import shown
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit, positive
from skyarm.reference import Reference
from skyarm.sensing.measurement import Measurement
from skyarm.vehicle import Vehicle

SCHEMA = 1
FILE = "hummingbird_arm2.json"

SEEN = 0.2
"""Relative variation of masses in the training of the network."""


@immutable
class Layer:
    """Affine map: weights (outputs x inputs) and offsets (outputs)."""

    weights: Annotated[
        tuple[Scalars, ...], Unit("", "weights of a layer, one row for each output")
    ]
    offsets: Annotated[Scalars, Unit("", "offsets of a layer, one for each output")]


@immutable
class Network:
    """Feed-forward network with tanh layers and normalised inputs.

    Attributes:
        means, factors: mean of each input, and one over its deviation.
        layers: the last is linear.
        scales: scale of each output. limits: largest magnitude of each output, in its
            unit.
    """

    means: Annotated[Scalars, Unit("", "means of the inputs, in their units")]
    factors: Annotated[Scalars, Unit("", "reciprocal standard deviation of each input")]
    layers: tuple[Layer, ...]
    scales: Annotated[
        Scalars,
        Unit("", "scale of the outputs: N and N m in base axes, then joint torques"),
    ]
    limits: Annotated[
        Scalars, Unit("", "largest magnitude of each output, in its unit")
    ]

    def __call__(self, inputs: Sequence[Scalar]) -> Scalars:
        """Network outputs, clipped to their limits."""
        values = [
            mul(sub(x, m), f)
            for x, m, f in zip(inputs, self.means, self.factors, strict=True)
        ]
        for i, layer in enumerate(self.layers):
            sums = [
                total([offset, *(mul(w, x) for w, x in zip(row, values, strict=True))])
                for row, offset in zip(layer.weights, layer.offsets, strict=True)
            ]
            values = (
                [tanh(value) for value in sums] if i + 1 < len(self.layers) else sums
            )
        return tuple(
            clip(mul(value, scale), -limit, limit)
            for value, scale, limit in zip(
                values, self.scales, self.limits, strict=True
            )
        )


Training = dict[str, Any]
"""Training record of a network, as stored in its file."""


def read_network(text: str) -> tuple[Network, Training]:
    """Read a network and its training record from the text of a file.

    Raises:
        ValueError: it is not such a file.
    """
    try:
        table = json.loads(text)
        if table["schema"] != SCHEMA:
            raise ValueError(f"schema = {shown(table['schema'])}: must be {SCHEMA}")
        layers = tuple(
            Layer(
                weights=tuple(map(_numbers, each["weights"])),
                offsets=_numbers(each["offsets"]),
            )
            for each in table["layers"]
        )
        parts = {
            name: _numbers(table[name])
            for name in ("means", "factors", "scales", "limits")
        }
    except (KeyError, TypeError) as error:
        raise ValueError(
            f"network: {error!r}: must be a file that the training wrote"
        ) from None
    return Network(layers=layers, **parts), table["training"]


def numbers_of(vehicle: Vehicle) -> dict[str, list[float]]:
    """Masses (kg, base first) and joint positions (m, in the parent link) that identify
    a vehicle.
    """
    return {
        "masses": [float(body.mass) for body in vehicle.bodies],
        "places": [float(c) for joint in vehicle.joints for c in joint.position],
    }


def unlike(vehicle: Vehicle, training: Training) -> str:
    """Differences between a vehicle and the one that a network was trained on, as text;
    empty if equal or unknown.
    """
    recorded = training.get("numbers", {})
    # numbers that vary from flight to flight are of no one vehicle to compare
    if not concrete(
        *(body.mass for body in vehicle.bodies),
        *(c for joint in vehicle.joints for c in joint.position),
    ):
        return ""
    for name, there in numbers_of(vehicle).items():
        trained = recorded.get(name, there)
        # a place may have zeros, of which a relative slack is none
        slack = SEEN * max(map(abs, trained), default=0.0) if name == "places" else 0.0
        if len(there) != len(trained) or not np.allclose(
            there, trained, rtol=SEEN, atol=slack
        ):
            return (
                f"{name} {shown([round(value, 4) for value in there])}, trained with"
                f" {shown(trained)}"
            )
    return ""


def shipped_network() -> tuple[Network, Training]:
    """Network shipped with the package, and its training record."""
    return read_network(Path(__file__).with_name(FILE).read_text("utf-8"))


def _numbers(values: Iterable[float]) -> tuple[float, ...]:
    return tuple(map(float, values))


HISTORY = 15.0
"""Bandwidth (rad/s) of the input filters: fast for gusts of some tenths of a second,
slow for noise of 1 cm/s."""


@immutable
class History:
    """Low-pass filtered motion and commands, for the network's inputs.

    Attributes:
        started: 0 before the first measurement. commanded: 0 before the first command.
        motion: velocity (world axes, m/s), rate (base axes, rad/s) and joint rates.
        commands: force and torque of the commanded rotor speeds in still air (base
            axes, N, N m), then joint efforts.
    """

    started: Annotated[Scalar, Unit("", "0 before the first measurement")]
    commanded: Annotated[Scalar, Unit("", "0 before the first command")]
    motion: Annotated[
        Scalars,
        Unit(
            "m/s, rad/s", "filtered velocity in world axes, body rate and joint rates"
        ),
    ]
    commands: Annotated[
        Scalars,
        Unit(
            "N, N m",
            "filtered wrench of the commanded rotors in still air, and joint efforts",
        ),
    ]


def no_history(joints: int) -> History:
    """Initial history for the network's inputs: no motion and no commands."""
    still = (0.0,) * (6 + joints)
    return History(started=0.0, commanded=0.0, motion=still, commands=still)


def feature_names(joints: int) -> tuple[str, ...]:
    """Names of the network's input features, in order."""
    axes = ("x", "y", "z")
    arm = tuple(str(i + 1) for i in range(joints))
    groups = {
        **dict.fromkeys(("velocity_B", "up_B", "rate_B"), axes),
        **dict.fromkeys(("joint", "joint_rate"), arm),
        **dict.fromkeys(("acceleration_B", "angular_acceleration_B"), axes),
        "joint_acceleration": arm,
        **dict.fromkeys(("position_error_B", "velocity_error_B"), axes),
        **dict.fromkeys(("joint_error", "joint_rate_error"), arm),
        **dict.fromkeys(("force_B", "torque_B"), axes),
        "effort": arm,
    }
    return tuple(f"{group} {part}" for group, parts in groups.items() for part in parts)


def features(
    measurement: Measurement, reference: Reference, history: History
) -> Scalars:
    """Input vector of the network from measurement, reference and filtered history."""
    m, R = measurement, measurement.rotation
    new = history.started < 0.5
    pairs = zip(_velocities(m), history.motion, strict=True)
    # what a low pass has still to go, times its rate, is a filtered derivative
    rises = [where(new, 0.0, HISTORY * (x - filtered)) for x, filtered in pairs]
    return (
        *R.apply_T(m.velocity),
        *R.apply_T(E_Z),
        *m.rate,
        *m.joints,
        *m.joint_rates,
        *R.apply_T(Vec3(*rises[:3])),
        *rises[3:],
        *R.apply_T(m.position - reference.position),
        *R.apply_T(m.velocity - reference.velocity),
        *differences(m.joints, reference.joints),
        *differences(m.joint_rates, reference.joint_rates),
        *history.commands,
    )


def _velocities(measurement: Measurement) -> Scalars:
    return (*measurement.velocity, *measurement.rate, *measurement.joint_rates)


def with_motion(history: History, measurement: Measurement, dt: Scalar) -> History:
    """History of network inputs updated by a new measurement."""
    new = history.started < 0.5
    motion = _filter_values(new, history.motion, _velocities(measurement), dt)
    return replace(history, started=where(new, 1.0, history.started), motion=motion)


def with_command(
    vehicle: Vehicle, history: History, command: Command, dt: Scalar
) -> History:
    """History of network inputs updated by the last command."""
    pushed = calm_wrench(vehicle, command.rotor_speeds)
    begun = history.started > 0.5
    sent = (
        *pushed.force,
        *pushed.torque,
        *command.efforts,
    )
    after = _filter_values(history.commanded < 0.5, history.commands, sent, dt)
    return replace(
        history,
        commanded=where(begun, 1.0, history.commanded),
        commands=choose_each(begun, after, history.commands),
    )


def _filter_values(
    new: Scalar, filtered: Iterable[Scalar], values: Iterable[Scalar], dt: Scalar
) -> Scalars:
    """Low-pass filter step of several values; a new filter starts at its first
    input.
    """
    return tuple(
        where(new, x, low_pass(y, x, HISTORY, dt))
        for y, x in zip(filtered, values, strict=True)
    )


@immutable
class LearnedParameters(Parameters):
    """Constants of the learned law: those of computed torque, the network, and its
    output filter's bandwidth.
    """

    network: Network
    answer: Annotated[
        float,
        positive(
            "rad/s",
            "bandwidth of the filter of the network's output",
            high=1e4,
            effect="lower values pass less noise and learn slow disturbances only",
        ),
    ] = 10.0


@immutable
class LearnedMemory:
    """State of the learned law: input history, last command, and filtered network
    output.

    The last command, ``sent``, enters the history one step later, when it is known
    whether it was sent as desired.
    """

    history: History
    sent: Command
    answer: Annotated[
        Scalars,
        Unit(
            "",
            "filtered output: force and torque at the base, base axes, then joint"
            " torques",
        ),
    ]


def learned_compensator(
    memory: LearnedMemory,
    measurement: Measurement,
    reference: Reference,
    dt: Scalar,
    *,
    par: LearnedParameters,
) -> tuple[LearnedMemory, Command]:
    """Computed torque of Barakou et al. 2026 minus a network's estimate of unmodelled
    forces.

    Source: Wu et al. 2024 (idea only), Barakou et al. 2026, eq. (82)-(96).
    """
    history = with_command(par.model.vehicle, memory.history, memory.sent, dt)
    estimate = par.network(features(measurement, reference, history))
    answer = tuple(
        low_pass(old, new, par.answer, dt)
        for old, new in zip(memory.answer, estimate, strict=True)
    )
    command = compensate(measurement, reference, answer, par)
    return (
        LearnedMemory(
            history=with_motion(history, measurement, dt), sent=command, answer=answer
        ),
        command,
    )


def compensate(
    measurement: Measurement,
    reference: Reference,
    unknown: Scalars,
    par: LearnedParameters,
) -> Command:
    """Command of Barakou et al. 2026's law minus a force and torque (base axes) and
    joint torques.
    """
    vehicle, R = par.model.vehicle, measurement.rotation
    force_B, torque_B = Vec3(*unknown[:3]), Vec3(*unknown[3:6])
    specific = wanted_specific_force(par, measurement, reference)
    # what pushes already need not be thrust
    thrust = specific - R.apply(force_B) * divide(1.0, vehicle.mass)
    alpha = turn_towards(par, measurement, reference, R, thrust)
    base = Motion(alpha, R.apply_T(specific))
    qdd = joint_accelerations(par, measurement, reference)
    force, torques = coupled_forces(par, measurement, base, qdd)
    efforts = differences(torques, unknown[6:])
    return make_command(
        par, force.torque - torque_B, force.force.z - force_B.z, efforts
    )


def network_for(model: Model, network: Any) -> Network:
    """Network for a model: the given or the shipped one; rejects a network of another
    vehicle.

    Raises:
        ControllerError: it is not one of a vehicle with these joints, or the shipped
            one is not of this vehicle.
    """
    n = model.vehicle.n
    chosen, training = (network, {}) if network != () else shipped_network()
    if not isinstance(chosen, Network):
        raise ControllerError(
            f"controller.network = {shown(network)}: must be a Network"
        )
    train = "train one with examples/learned_compensator/train.py"
    if len(chosen.means) != len(feature_names(n)) or len(chosen.scales) != 6 + n:
        raise ControllerError(
            f"controller.network: takes {len(chosen.means)} inputs, a vehicle of {n}"
            f" joints gives {len(feature_names(n))}; {train}"
        )
    if other := unlike(model.vehicle, training):
        raise ControllerError(
            "controller.network: the shipped one is of another vehicle than"
            f" '{model.vehicle.name}' ({other}); {train}, or give this one as network="
        )
    return chosen


def first_memory(par: LearnedParameters) -> LearnedMemory:
    """Initial internal state of the learned law: no history, zero network output."""
    n = par.model.vehicle.n
    return LearnedMemory(
        history=no_history(n),
        sent=no_command(par.model.vehicle),
        answer=(0.0,) * (6 + n),
    )


make_learned_controller = law_maker(
    "learned_compensator",
    learned_compensator,
    LearnedParameters,
    readers={"network": ((), network_for)},
    memory=first_memory,
    rate_error="rotors_sim",
)
"""Maker of the learned law's controllers; ``network`` = () selects the shipped
network."""
