"""Train the network of the law ``learned_compensator`` on simulated flights: ``python train.py FILE.json``.

Flights of random motions in random winds with random masses, payloads and joint friction are flown first with the
paper's law, then with the law and the network so far, so that the network also sees the states to which its own answers
lead (Ross, Gordon, Bagnell 2011). Its target is the generalized force that the model leaves out: inverse dynamics of
the model at the flown acceleration, less the forces of rotors and joints. Everything follows from the seed. Change
``MODEL``, ``TRUTH`` and ``random_scenario`` for another vehicle, and give the law the file's network: ``network =
read_network(text)[0]``.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.algebra import ZERO3, Force, Quaternion, Vec3
from skyarm.control.catalogue import ACCELERATION, HUMMINGBIRD, preset
from skyarm.control.controller import Controller
from skyarm.control.laws.learned.law import (
    HISTORY,
    SCHEMA,
    Layer,
    Network,
    feature_names,
    features,
    make_learned_controller,
    no_history,
    numbers_of,
    with_command,
    with_motion,
)
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.dynamics import array_front as arrays
from skyarm.dynamics.actuators import Command, rotor_force
from skyarm.log.flight_log import Log
from skyarm.plant.interface import Truth
from skyarm.records.files import write_atomically
from skyarm.reference import Reference, Trajectory, circle, hover
from skyarm.reference.signals import Sine
from skyarm.scenario.scenario_record import Scenario
from skyarm.sensing.measurement import SensorNoise, measure, noise_count
from skyarm.simulate.loop import run
from skyarm.studies.trial.trial import NOISE
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.vehicle.vehicle_records import Vehicle
from skyarm.world import ForceWind, Gust, Payload

Array = npt.NDArray[np.float64]
Progress = Callable[[str], None]

MODEL, TRUTH = "hummingbird_arm2", "hummingbird_arm2_rotors"
"""Vehicles of the law's model and, perturbed, of the plant."""


def random_scenario(rng: np.random.Generator, controller: Controller, duration: float, index: int) -> Scenario:
    """A flight of the perturbed truth on a random motion in random wind; odd ones have the bench's noise.

    Args:
        rng: gives all that is random.
        controller: that flies it.
        duration: s.
        index: number of the flight.
    """
    truth = _perturbed(rng, load_vehicle(TRUTH))
    direction = rng.normal(size=3) * [1.0, 1.0, 0.3]
    force = direction / np.linalg.norm(direction) * rng.uniform(0.0, 3.0)
    gust = rng.normal(size=3) * [1.0, 1.0, 0.3]
    wind = ForceWind(
        force_W=Vec3(*force.tolist()),
        air_velocity_W=Vec3(*(force * rng.uniform(0.0, 1.5)).tolist()),
        gust=Gust(
            peak=Vec3(*(gust / np.linalg.norm(gust) * rng.uniform(0.0, 3.0)).tolist()),
            start=float(rng.uniform(0.2, 0.6) * duration),
            duration=float(rng.uniform(0.5, 3.0)),
        ),
    )
    return Scenario(
        name=f"learn {index}",
        duration=duration,
        plant=Truth(vehicle=truth, gravity=9.8),
        controller=controller,
        reference=_motion(rng),
        wind=wind,
        noise=NOISE if noisy(index) else SensorNoise(),
        seed=int(rng.integers(2**31)),
        ground=False,
    )


def noisy(index: int) -> bool:
    """Whether a flight's sensors are noisy: every second one's."""
    return index % 2 == 1


def _perturbed(rng: np.random.Generator, vehicle: Vehicle) -> Vehicle:
    """Masses and inertias +-20 %, thrust -10 to +5 %, joint damping 0 to 0.02, payload 0 to 100 g."""
    base = dataclasses.replace(vehicle.base, mass=vehicle.base.mass * rng.uniform(0.9, 1.2))
    links = tuple(
        dataclasses.replace(
            link, body=dataclasses.replace(link.body, mass=link.body.mass * float(rng.uniform(0.8, 1.2)))
        )
        for link in vehicle.links
    )
    thrust = float(rng.uniform(0.9, 1.05))
    rotors = tuple(
        dataclasses.replace(rotor, thrust_coefficient=rotor.thrust_coefficient * thrust) for rotor in vehicle.rotors
    )
    changed = dataclasses.replace(vehicle, base=base, links=links, rotors=rotors)
    changed = changed.with_joints(damping=float(rng.uniform(0.0, 0.02)))
    mass = float(rng.uniform(-0.1, 0.1))
    return Payload(mass=mass).held_by(changed) if mass > 0.0 else changed


def _motion(rng: np.random.Generator) -> Trajectory:
    """A circle or a hover, joints on sines."""
    joints = tuple(
        Sine(
            amplitude=float(rng.uniform(0.0, 0.5)),
            frequency_hz=float(rng.uniform(0.1, 0.8)),
            phase=float(rng.uniform(0.0, 2.0 * math.pi)),
        )
        for _ in range(2)
    )
    center = [0.0, 0.0, 2.0]
    if rng.uniform() < 0.3:
        return hover(center, joints=joints)
    return circle(
        radius=float(rng.uniform(0.1, 1.0)), frequency_hz=float(rng.uniform(-0.2, 0.2)), center=center, joints=joints
    )


PERIOD = 0.005
"""s, of the control."""


def residuals(model: Model, log: Log) -> Array:
    """What the model leaves out of a flight (N - 1, 6 + n): force and torque in base axes, joint torques."""
    vehicle = model.vehicle
    velocity = np.hstack([log.velocity, log.rate, log.joint_rates])
    acceleration = np.diff(velocity, axis=0) / PERIOD
    needed = arrays.inverse_dynamics(
        vehicle,
        log.position[:-1],
        log.quaternion[:-1],
        log.joints[:-1],
        velocity[:-1],
        acceleration,
        gravity=float(model.gravity),
    )
    speeds = 0.5 * (log.rotor_speeds[:-1] + log.rotor_speeds[1:])
    pushed = Force(ZERO3, ZERO3)
    for rotor, speed in zip(vehicle.rotors, speeds.T, strict=True):
        pushed = pushed + rotor_force(rotor, speed, ZERO3)
    force = Quaternion(*log.quaternion[:-1].T).rotation().apply_T(Vec3(*needed[:, :3].T)) - pushed.force
    torque = Vec3(*needed[:, 3:6].T) - pushed.torque
    still = np.zeros(len(speeds))
    base = [still + np.asarray(c) for c in (*force, *torque)]
    return np.column_stack([*base, needed[:, 6:] - log.efforts[:-1]])


def samples(model: Model, logs: Sequence[Log], noisy: Sequence[bool], rng: np.random.Generator) -> tuple[Array, Array]:
    """What the network sees and what it shall tell, of flights of one length.

    Args:
        model: the belief.
        logs: flights.
        noisy: which of them are seen through the bench's noise, drawn anew.
        rng: gives the noise.

    Returns:
        inputs (flights, N - 1, features) and outputs (flights, N - 1, 6 + n); outputs pass the filter that the inputs'
        history passes.
    """
    vehicle, count = model.vehicle, len(logs[0].time) - 1
    draws = noise_count(vehicle.n, len(vehicle.rotors))
    switch = np.array(noisy, dtype=float)
    truth = np.stack([residuals(model, log) for log in logs])
    history: Any = no_history(vehicle.n)
    inputs, outputs, filtered = [], [], truth[:, 0]
    for k in range(count):
        noise = switch * rng.normal(size=(draws, len(logs)))
        m = measure(NOISE, float(logs[0].time[k]), _state(logs, k), ZERO3, list(noise))
        held = Reference(
            position=Vec3(*_column(logs, "position_held", k)),
            velocity=Vec3(*_column(logs, "velocity_held", k)),
            joints=tuple(_column(logs, "joints_held", k)),
            joint_rates=tuple(_column(logs, "joint_rates_held", k)),
        )
        inputs.append(np.stack([np.broadcast_to(x, (len(logs),)) for x in features(m, held, history)], axis=1))
        filtered = filtered + (1.0 - math.exp(-HISTORY * PERIOD)) * (truth[:, k] - filtered)
        outputs.append(filtered)
        efforts = tuple(_column(logs, "efforts", k))
        command = Command(rotor_speeds=tuple(_column(logs, "rotor_commands", k)), efforts=efforts)
        history = with_command(vehicle, with_motion(history, m, PERIOD), command, PERIOD)
    return np.stack(inputs, axis=1), np.stack(outputs, axis=1)


def _column(logs: Sequence[Log], name: str, k: int) -> Array:
    """A quantity of all flights at an instant: (components, flights)."""
    return np.stack([getattr(log, name)[k] for log in logs], axis=1)


def _state(logs: Sequence[Log], k: int) -> State:
    """The true states of all flights at an instant."""
    return State(
        position=Vec3(*_column(logs, "position", k)),
        quaternion=Quaternion(*_column(logs, "quaternion", k)),
        velocity=Vec3(*_column(logs, "velocity", k)),
        rate=Vec3(*_column(logs, "rate", k)),
        joints=tuple(_column(logs, "joints", k)),
        joint_rates=tuple(_column(logs, "joint_rates", k)),
        rotor_speeds=tuple(_column(logs, "rotor_speeds", k)),
    )


@dataclass(frozen=True, kw_only=True, slots=True)
class Budget:
    """How much is flown and trained.

    Attributes:
        flights: of each round. rounds: the first with the paper's law, the others with the network so far.
        duration: of a flight, s. hidden: units of each of the two hidden layers.
        epochs: passes over the samples in a round. batch: samples of a step. every: control periods between samples.
        rate: of Adam, at its start; it falls to a tenth.
        seed: of everything.
    """

    flights: int = 48
    rounds: int = 3
    duration: float = 8.0
    hidden: int = 32
    epochs: int = 40
    batch: int = 512
    every: int = 4
    rate: float = 3e-3
    seed: int = 0


class Trainer:
    """Weights of a perceptron under training by Adam on the mean squared error of scaled outputs.

    Source: Kingma, Ba 2015 (Adam); Glorot, Bengio 2010 (first weights).
    """

    def __init__(self, sizes: Sequence[int], rng: np.random.Generator) -> None:
        self.rng = rng
        self.parts: list[Array] = []
        for a, b in pairwise(sizes):
            edge = math.sqrt(6.0 / (a + b))
            self.parts += [rng.uniform(-edge, edge, size=(a, b)), np.zeros(b)]
        self._first = [np.zeros_like(part) for part in self.parts]
        self._second = [np.zeros_like(part) for part in self.parts]
        self._steps = 0

    def values(self, x: Array) -> list[Array]:
        """Values of all layers."""
        found = [x]
        for i in range(0, len(self.parts), 2):
            z = found[-1] @ self.parts[i] + self.parts[i + 1]
            found.append(np.tanh(z) if i + 2 < len(self.parts) else z)
        return found

    def step(self, x: Array, y: Array, rate: float) -> float:
        """One step on a batch; its loss before the step."""
        layers = self.values(x)
        error = layers[-1] - y
        back, slopes = 2.0 * error / error.size, [np.empty(0)] * len(self.parts)
        for i in reversed(range(0, len(self.parts), 2)):
            if i + 2 < len(self.parts):
                back = back * (1.0 - layers[i // 2 + 1] ** 2)
            slopes[i], slopes[i + 1] = layers[i // 2].T @ back, back.sum(axis=0)
            back = back @ self.parts[i].T
        self._steps += 1
        for i, slope in enumerate(slopes):
            self._first[i] += 0.1 * (slope - self._first[i])
            self._second[i] += 0.001 * (slope * slope - self._second[i])
            grown = self._first[i] / (1.0 - 0.9**self._steps)
            squared = self._second[i] / (1.0 - 0.999**self._steps)
            self.parts[i] -= rate * grown / (np.sqrt(squared) + 1e-8)
        return float(np.mean(error * error))


def fitted(x: Array, y: Array, budget: Budget, rng: np.random.Generator) -> tuple[Network, list[float]]:
    """A network for samples (N, inputs) -> (N, outputs), and its loss per epoch."""
    means, deviations = x.mean(axis=0), np.maximum(x.std(axis=0), 1e-3)
    scales = np.maximum(y.std(axis=0), 1e-4)
    u, v = (x - means) / deviations, y / scales
    trainer = Trainer((x.shape[1], budget.hidden, budget.hidden, y.shape[1]), rng)
    losses = []
    for epoch in range(budget.epochs):
        rate = budget.rate * 0.1 ** (epoch / max(1, budget.epochs - 1))
        order = rng.permutation(len(u))
        parts = [order[i : i + budget.batch] for i in range(0, len(order), budget.batch)]
        losses.append(float(np.mean([trainer.step(u[part], v[part], rate) for part in parts])))
    layers = tuple(
        Layer(weights=_rows(trainer.parts[i].T), offsets=_row(trainer.parts[i + 1]))
        for i in range(0, len(trainer.parts), 2)
    )
    limits = 1.2 * np.quantile(np.abs(y), 0.999, axis=0)
    network = Network(
        means=_row(means), factors=_row(1.0 / deviations), layers=layers, scales=_row(scales), limits=_row(limits)
    )
    return network, losses


def _row(values: Array) -> tuple[float, ...]:
    # six digits, as the file has them, so that what is tried is what is shipped
    return tuple(float(f"{value:.6g}") for value in values.tolist())


def _rows(values: Array) -> tuple[tuple[float, ...], ...]:
    return tuple(_row(row) for row in values)


@dataclass(frozen=True, slots=True)
class Learned:
    """What came out: the network, loss (mean squared scaled error) per epoch, held-out RMS error and RMS of the truth.

    Errors are per output: force (N) and torque (N m) at the base, base axes, then joint torques (N m).
    """

    network: Network
    losses: list[float]
    held_out: Array
    truth: Array
    samples: int


def learn(budget: Budget, progress: Progress = lambda _line: None) -> Learned:
    """Fly, train, fly with what was trained, train again; flights of the last tenth are held out."""
    model = Model(vehicle=load_vehicle(MODEL))
    controller = preset("paper_ct", model)
    rng = np.random.default_rng(budget.seed)
    xs: list[Array] = []
    ys: list[Array] = []
    test_x: list[Array] = []
    test_y: list[Array] = []
    losses: list[float] = []
    held = max(1, budget.flights // 10)
    for turn in range(budget.rounds):
        logs, seen = [], []
        for index in range(budget.flights):
            log = run(random_scenario(rng, controller, budget.duration, index))
            if log.status == "completed":
                logs.append(log)
                seen.append(noisy(index))
        x, y = samples(model, logs, seen, rng)
        progress(f"round {turn + 1}: {len(logs)} of {budget.flights} flights of {budget.duration:g} s completed")
        keep = slice(None, None, budget.every)
        for many, part in (
            (xs, x[:-held, keep]),
            (ys, y[:-held, keep]),
            (test_x, x[-held:, keep]),
            (test_y, y[-held:, keep]),
        ):
            many.append(part.reshape(-1, part.shape[-1]))
        network, losses = fitted(np.vstack(xs), np.vstack(ys), budget, np.random.default_rng(budget.seed + turn + 1))
        controller = make_learned_controller(model, network=network, gains=HUMMINGBIRD, joint_gains=ACCELERATION)
        truth = np.vstack(test_y)
        told = np.stack([np.broadcast_to(c, (len(truth),)) for c in network(tuple(np.vstack(test_x).T))], axis=1)
        error = np.sqrt(np.mean((told - truth) ** 2, axis=0))
        progress(f"  loss {losses[0]:.4f} -> {losses[-1]:.4f}; held-out RMS {np.array2string(error, precision=4)}")
    return Learned(network, losses, error, np.sqrt(np.mean(truth**2, axis=0)), sum(x.shape[0] for x in xs))


def write_network(network: Network, training: dict[str, Any]) -> str:
    """The text of a network's file; six digits are kept, so that it reads back as it is used."""
    table: dict[str, Any] = {"schema": SCHEMA, "training": training}
    table |= {name: _rounded(getattr(network, name)) for name in ("means", "factors", "scales", "limits")}
    table["layers"] = [
        {"weights": [_rounded(row) for row in layer.weights], "offsets": _rounded(layer.offsets)}
        for layer in network.layers
    ]
    return json.dumps(table, indent=None, separators=(",", ":")).replace("],[", "],\n[") + "\n"


def _rounded(values: Sequence[Any]) -> list[float]:
    return [float(f"{float(value):.6g}") for value in values]


def training_record(budget: Budget, learned: Learned) -> dict[str, Any]:
    """What a network's file says of how it came about."""
    outputs = ["force_B x", "force_B y", "force_B z", "torque_B x", "torque_B y", "torque_B z", "effort 1", "effort 2"]
    return {
        "command": "python examples/learned_compensator/train.py FILE",
        "vehicle": f"{MODEL} (model), {TRUTH} perturbed (truth)",
        "numbers": numbers_of(load_vehicle(MODEL)),
        "budget": dataclasses.asdict(budget),
        "samples": learned.samples,
        "inputs": list(feature_names(2)),
        "outputs": outputs,
        "held_out_rms_error": [float(f"{v:.3g}") for v in learned.held_out],
        "held_out_rms": [float(f"{v:.3g}") for v in learned.truth],
    }


def main() -> None:
    """Train and write the file."""
    parser = argparse.ArgumentParser(description="Train the network of the learned compensator.")
    parser.add_argument("file", help="JSON file that is written")
    budget = Budget()
    for name in ("flights", "rounds", "epochs", "seed"):
        parser.add_argument(f"--{name}", type=int, default=getattr(budget, name))
    given = vars(parser.parse_args())
    path = given.pop("file")
    budget = dataclasses.replace(budget, **given)
    learned = learn(budget, print)
    write_atomically(path, write_network(learned.network, training_record(budget, learned)).encode())


if __name__ == "__main__":
    main()
