"""The paper's computed torque with a learned compensator, in the style of Wu 2024.

Law: a network of two hidden layers of 32 tanh tells, from motion, errors and a short history of velocities and
commands, the force and torque at the base and the torques at the joints that the model leaves out. Its filtered answer
is taken off the wanted force before the thrust is aimed, and off the inverse dynamics.

Assumed, since the equations of Wu 2024 were not at hand: the network replaces a disturbance observer around a computed
torque law; its inputs and size; supervised training on simulated flights, no adaptation in flight; one filter of 15
rad/s per velocity and command stands for the history; the answer is limited to what training has seen and filtered.

Tuning: ``answer`` (rad/s), the paper's gains. The shipped weights are those of the Hummingbird with the two-joint arm;
``examples/learned_compensator/train.py`` makes them again.

Source: Wu et al. 2024 (idea only); base law Barakou et al. 2026, eq. (82)-(96).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from skyarm import dynamics
from skyarm.actuation import Command
from skyarm.algebra import Motion, Vec3
from skyarm.control.blocks.common import make_command, no_command, turn_towards, wanted_specific_force
from skyarm.control.controller import ControllerError
from skyarm.control.law_maker import law_maker
from skyarm.control.laws.learned.features import History, feature_names, features, no_history, with_command, with_motion
from skyarm.control.laws.learned.network import Network, shipped_network, unlike
from skyarm.control.laws.paper import joint_accelerations
from skyarm.control.model import Model, Parameters
from skyarm.files import shown
from skyarm.records.units import Unit
from skyarm.reference import Reference
from skyarm.scalars import Scalar, add, divide, exp, mul, sub
from skyarm.sensors.measurement import Measurement


@dataclass(frozen=True, kw_only=True, slots=True)
class LearnedParameters(Parameters):
    """Constants of the law: those of the paper's law, the network, and the bandwidth of its filtered output (rad/s)."""

    network: Network
    answer: Annotated[float, Unit("rad/s", "bandwidth of the filtered answer", low=0.0, high=1e4, strict=True)] = 10.0


@dataclass(frozen=True, kw_only=True, slots=True)
class LearnedMemory:
    """History that the network sees, and its filtered answer: force and torque, base axes (N, N m), joint torques.

    The last command, ``sent``, enters the history one step later, when it is known whether it was sent as desired.
    """

    history: History
    sent: Command
    answer: Annotated[tuple[Scalar, ...], Unit("", "N and N m at the base, base axes, then joint torques; filtered")]


def learned_compensator(
    memory: LearnedMemory, measurement: Measurement, reference: Reference, dt: Any, *, par: LearnedParameters
) -> tuple[LearnedMemory, Command]:
    """The paper's computed torque, less the network's estimate of what the model lacks.

    Source: Wu et al. 2024 (idea only), Barakou et al. 2026, eq. (82)-(96).
    """
    history = with_command(par.model.vehicle, memory.history, memory.sent, dt)
    told = par.network(features(measurement, reference, history))
    share = 1.0 - exp(mul(-par.answer, dt))
    answer = tuple(add(old, mul(share, sub(new, old))) for old, new in zip(memory.answer, told, strict=True))
    command = compensated(measurement, reference, answer, par)
    return LearnedMemory(history=with_motion(history, measurement, dt), sent=command, answer=answer), command


def compensated(
    measurement: Measurement, reference: Reference, unknown: tuple[Any, ...], par: LearnedParameters
) -> Command:
    """Commands of the paper's law under an unknown force and torque (base axes) and unknown joint torques."""
    vehicle, R = par.model.vehicle, measurement.quaternion.rotation()
    force_B, torque_B = Vec3(*unknown[:3]), Vec3(*unknown[3:6])
    specific = wanted_specific_force(par, measurement, reference)
    # what pushes already need not be thrust
    thrust = specific - R.apply(force_B) * divide(1.0, vehicle.mass)
    alpha = turn_towards(par, measurement, reference, R, thrust)
    base = Motion(alpha, R.apply_T(specific))
    wanted = joint_accelerations(par, measurement, reference)
    force, torques = dynamics.inverse_dynamics(
        vehicle, measurement.joints, measurement.rate, measurement.joint_rates, base, wanted
    )
    efforts = tuple(sub(t, u) for t, u in zip(torques, unknown[6:], strict=True))
    return make_command(par, force.torque - torque_B, force.force.z - force_B.z, efforts)[0]


def network_for(model: Model, network: Any) -> Network:
    """A network for a model, by default the shipped one, for a vehicle like that of its training.

    Raises:
        ControllerError: it is not one of a vehicle with these joints, or the shipped one is not of this vehicle.
    """
    if not isinstance(network, (Network, tuple)):
        raise ControllerError(f"controller.network = {shown(network)}: must be a Network")
    n = model.vehicle.n
    found, training = (network, {}) if isinstance(network, Network) else shipped_network()
    train = "train one with examples/learned_compensator/train.py"
    if len(found.means) != len(feature_names(n)) or len(found.scales) != 6 + n:
        raise ControllerError(
            f"controller.network: takes {len(found.means)} inputs, a vehicle of {n} joints gives "
            f"{len(feature_names(n))}; {train}"
        )
    if other := unlike(model.vehicle, training):
        raise ControllerError(
            f"controller.network: the shipped one is of another vehicle than '{model.vehicle.name}' ({other}); "
            f"{train}, or give this one as network="
        )
    return found


def first_memory(par: LearnedParameters) -> LearnedMemory:
    """No history and no answer."""
    n = par.model.vehicle.n
    return LearnedMemory(history=no_history(n), sent=no_command(par.model.vehicle), answer=(0.0,) * (6 + n))


make_learned_controller = law_maker(
    "learned_compensator",
    learned_compensator,
    LearnedParameters,
    readers={"network": ((), network_for)},
    memory=first_memory,
    rate_error="rotors_sim",
)
"""Maker for a vehicle of the network's training; () is the shipped network."""
