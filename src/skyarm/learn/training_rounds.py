"""Rounds of flying and training, each flown with the network so far."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.control.catalogue import ACCELERATION, HUMMINGBIRD, preset
from skyarm.control.laws.learned.features import feature_names
from skyarm.control.laws.learned.law import make_learned_controller
from skyarm.control.laws.learned.network import Network, numbers_of
from skyarm.control.model import Model
from skyarm.learn.learning_flights import noisy, random_scenario
from skyarm.learn.samples import samples
from skyarm.learn.training import Budget, fitted
from skyarm.simulate.loop import run
from skyarm.vehicle.vehicle_files import load_vehicle

Array = npt.NDArray[np.float64]
Progress = Callable[[str], None]


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
    model = Model(vehicle=load_vehicle("hummingbird_arm2"))
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


def training_record(budget: Budget, learned: Learned) -> dict[str, Any]:
    """What a network's file says of how it came about."""
    outputs = ["force_B x", "force_B y", "force_B z", "torque_B x", "torque_B y", "torque_B z", "effort 1", "effort 2"]
    return {
        "command": "python -m skyarm.learn FILE",
        "vehicle": "hummingbird_arm2 (model), hummingbird_arm2_rotors perturbed (truth)",
        "numbers": numbers_of(load_vehicle("hummingbird_arm2")),
        "budget": dataclasses.asdict(budget),
        "samples": learned.samples,
        "inputs": list(feature_names(2)),
        "outputs": outputs,
        "held_out_rms_error": [float(f"{v:.3g}") for v in learned.held_out],
        "held_out_rms": [float(f"{v:.3g}") for v in learned.truth],
    }
