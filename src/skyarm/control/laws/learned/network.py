"""A small traceable multilayer perceptron, and its file."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from typing import Annotated, Any

from skyarm.files import shown
from skyarm.records.coerce import concrete
from skyarm.records.units import Unit
from skyarm.scalars import Scalar, add, clip, mul, sub, tanh
from skyarm.vehicle.vehicle_records import Vehicle

SCHEMA = 1
FILE = "hummingbird_arm2.json"

SEEN = 0.2
"""Share by which masses vary in training."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Layer:
    """Affine map: weights (outputs x inputs) and offsets (outputs)."""

    weights: Annotated[tuple[tuple[Scalar, ...], ...], Unit("", "of a layer, a row an output")]
    offsets: Annotated[tuple[Scalar, ...], Unit("", "of a layer")]


@dataclass(frozen=True, kw_only=True, slots=True)
class Network:
    """Layers with tanh between them, on inputs brought to mean 0 and deviation 1.

    Attributes:
        means, factors: of the inputs; factor is one over the deviation.
        layers: the last is linear.
        scales: of the outputs. limits: largest magnitude of each output, in its unit.
    """

    means: Annotated[tuple[Scalar, ...], Unit("", "of the inputs, in their units")]
    factors: Annotated[tuple[Scalar, ...], Unit("", "one over the deviation of each input")]
    layers: tuple[Layer, ...]
    scales: Annotated[tuple[Scalar, ...], Unit("", "of the outputs: N and N m, base axes, then joint torques")]
    limits: Annotated[tuple[Scalar, ...], Unit("", "largest magnitude of each output, in its unit")]

    def __call__(self, inputs: Sequence[Any]) -> tuple[Any, ...]:
        """Outputs within their limits."""
        values = [mul(sub(x, m), f) for x, m, f in zip(inputs, self.means, self.factors, strict=True)]
        for i, layer in enumerate(self.layers):
            sums = [_affine(row, values, offset) for row, offset in zip(layer.weights, layer.offsets, strict=True)]
            values = [tanh(value) for value in sums] if i + 1 < len(self.layers) else sums
        return tuple(
            clip(mul(value, scale), -limit, limit)
            for value, scale, limit in zip(values, self.scales, self.limits, strict=True)
        )


def _affine(row: Sequence[Any], values: Sequence[Any], offset: Any) -> Any:
    total = offset
    for w, x in zip(row, values, strict=True):
        total = add(total, mul(w, x))
    return total


def read_network(text: str) -> tuple[Network, dict[str, Any]]:
    """A network and the record of its training, from the text of its file.

    Raises:
        ValueError: it is not such a file.
    """
    try:
        table = json.loads(text)
        if table["schema"] != SCHEMA:
            raise ValueError(f"schema = {shown(table['schema'])}: must be {SCHEMA}")
        layers = tuple(
            Layer(weights=tuple(_numbers(row) for row in each["weights"]), offsets=_numbers(each["offsets"]))
            for each in table["layers"]
        )
        parts = {name: _numbers(table[name]) for name in ("means", "factors", "scales", "limits")}
    except (KeyError, TypeError) as error:
        raise ValueError(f"network: {error!r}: must be a file that the training wrote") from None
    return Network(layers=layers, **parts), table["training"]


def write_network(network: Network, training: dict[str, Any]) -> str:
    """The text of a network's file; six digits are kept, so that it reads back as it is used."""
    table: dict[str, Any] = {"schema": SCHEMA, "training": training}
    table |= {name: _rounded(getattr(network, name)) for name in ("means", "factors", "scales", "limits")}
    table["layers"] = [
        {"weights": [_rounded(row) for row in layer.weights], "offsets": _rounded(layer.offsets)}
        for layer in network.layers
    ]
    return json.dumps(table, indent=None, separators=(",", ":")).replace("],[", "],\n[") + "\n"


def numbers_of(vehicle: Vehicle) -> dict[str, list[float]]:
    """Masses (kg, base first) and places of the joints (m, in their parents), by which a file knows its vehicle."""
    return {
        "masses": [float(body.mass) for body in vehicle.bodies],
        "places": [float(c) for link in vehicle.links for c in link.joint.position],
    }


def unlike(vehicle: Vehicle, training: dict[str, Any]) -> str:
    """Numbers of a vehicle outside a network's training range, in words; empty if none are or none are known."""
    known = training.get("numbers", {})
    if not concrete(
        *(body.mass for body in vehicle.bodies), *(c for link in vehicle.links for c in link.joint.position)
    ):
        return ""
    for name, there in numbers_of(vehicle).items():
        trained = known.get(name)
        if trained is None:
            continue
        slack = SEEN * max((abs(value) for value in trained), default=0.0) if name == "places" else 0.0
        near = (abs(a - b) <= SEEN * abs(b) + slack for a, b in zip(there, trained, strict=False))
        if len(there) != len(trained) or not all(near):
            return f"{name} {shown([round(value, 4) for value in there])}, trained with {shown(trained)}"
    return ""


def shipped_network() -> tuple[Network, dict[str, Any]]:
    """The network that comes with the package."""
    return read_network(resources.files("skyarm.control.laws.learned").joinpath(FILE).read_text(encoding="utf-8"))


def _numbers(values: Any) -> tuple[float, ...]:
    return tuple(float(value) for value in values)


def _rounded(values: Sequence[Any]) -> list[float]:
    return [float(f"{float(value):.6g}") for value in values]
