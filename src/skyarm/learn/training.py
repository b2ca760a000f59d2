"""Training of a perceptron by supervised samples."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from skyarm.control.laws.learned.network import Layer, Network

Array = npt.NDArray[np.float64]


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
