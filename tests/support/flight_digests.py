"""Digests of flights, kept so that no change of the house changes a bit of a flight.

``python tests/support/flight_digests.py FILE`` flies all of them and writes their
digests; that takes some half an hour. Each flight is one case of the paper with one
controller on one plant. The batches are 64 lanes of varied plants, winds, delays and
noise: to the bit in bit-exact machine code, by the numbers of their metrics in the fast
modes.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import sys
from collections.abc import Iterator
from importlib import metadata
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

import skyarm
from skyarm.control.catalogue import (
    LAWS,
    PRESETS,
    make_controller,
    suitable_options,
    tuned_factors,
)
from skyarm.control.model import Terms
from skyarm.log.metrics.windows import Window, Windows
from skyarm.records.leaves import leaves
from skyarm.scenario.controller_table import loop_facts
from skyarm.simulate.batch import Batch

CASES = ("case1", "case2", "case2_gust", "case3", "case3_wind")
PLANTS = ("rigid_body", "mujoco")
ARRAYS = (
    *(
        "time",
        "position",
        "quaternion",
        "velocity",
        "rate",
        "joints",
        "joint_rates",
        "efforts",
        "rotor_speeds",
    ),
    *(
        "rotor_commands",
        "position_held",
        "velocity_held",
        "joints_held",
        "joint_rates_held",
        "yaw_held",
    ),
    *(
        "position_reference",
        "joints_reference",
        "yaw_reference",
        "tool",
        "tool_held",
        "tool_reference",
    ),
    *("wind_force", "air_velocity", "measured_position", "measured_joints"),
)
"""Arrays of a log as they were when the digests were taken; later ones do not count."""

BATCHED = (
    "paper_ct",
    "paper_pd",
    "centroidal_tip",
    "centroidal_joint",
    "l1_adaptive",
    "indi",
    "kim2013",
)
LANES, SECONDS = 64, 6.0
MODES = ("bit_exact", "double", "single")


AS_TAKEN = {
    "centroidal": "exact",
    "ct_ladder": "ct_lag_inversion",
    "rotors_sim_position": "rotors_position",
    "rotors_sim_hummingbird": "rotors_hummingbird",
    "bulut2019": "bulut_computed_torque_style",
    "guo2023": "guo_center_of_inertia_style",
    "li2024": "li_feedforward_style",
    "kim2013": "kim_sliding_mode_style",
    "learned_compensator": "learned_compensator_style",
}
"""Names that controllers had when the digests were taken; the file keeps them."""


def as_taken(controller: str) -> str:
    """The name that stands in the file."""
    law = controller.removesuffix("_tuned")
    return AS_TAKEN.get(law, law) + controller[len(law) :]


YOUNGER = ("hybrid_ct", "admittance_pd")
"""Laws that there were not yet when the digests were taken; without a push they fly as
others."""


OPTIONS: dict[str, tuple[str, dict[str, Any]]] = {
    "ct_level_gravity": (
        "hybrid_computed_torque",
        {"terms": Terms(full_gravity=False)},
    ),
    "ct_coupled_thrust": ("ct_ladder", {"steps": 1}),
    "ct_consistent": ("ct_ladder", {"steps": 2}),
    "ct_observer": ("ct_ladder", {"steps": 3}),
    "ct_feedforward": ("ct_ladder", {"steps": 4}),
    "ct_extrapolation": ("ct_ladder", {"steps": 5}),
    "l1_adaptive_lateral": ("l1_adaptive", {"lateral": True}),
}
"""Options of a law under the names that they had when the digests were taken."""


def controllers() -> tuple[str, ...]:
    """Every preset, every law with some of its options, and every law with tuned gains,
    as far as there were any.
    """
    there = (*PRESETS, *LAWS, *OPTIONS, *(f"{law}_tuned" for law in tuned_factors()))
    return tuple(name for name in there if name.removesuffix("_tuned") not in YOUNGER)


def flights() -> Iterator[tuple[str, str, str]]:
    """(case, controller, plant) of every flight."""
    for plant in PLANTS:
        for controller in controllers():
            for case in CASES:
                yield case, controller, plant


def digest_of_arrays(arrays: dict[str, Any]) -> str:
    """SHA-256 of names, shapes and bytes."""
    found = hashlib.sha256()
    for name, array in arrays.items():
        found.update(f"{name} {array.shape} {array.dtype.str}".encode())
        found.update(np.ascontiguousarray(array).tobytes())
    return found.hexdigest()


def linear_algebra() -> str:
    """Digest of products, solutions and factors of fixed matrices: BLAS chooses its
    code by the processor.
    """
    generator = np.random.default_rng(0)
    found = {}
    for n in (6, 24, 120):
        a, b = generator.normal(size=(n, n)), generator.normal(size=n)
        symmetric = a @ a.T + n * np.eye(n)
        results = (
            symmetric,
            a @ b,
            np.linalg.solve(a, b),
            np.linalg.cholesky(symmetric),
            np.linalg.eigh(symmetric)[1],
        )
        found |= {f"{n} {k}": result for k, result in enumerate(results)}
    return digest_of_arrays(found)


def fly(case: str, controller: str, plant: str, duration: float | None = None) -> str:
    """Digest of a flight's log."""
    if controller not in OPTIONS:
        return _digest(
            skyarm.run(
                skyarm.load_scenario(
                    case, controller=controller, plant=plant, duration=duration
                )
            )
        )
    law, options = OPTIONS[controller]
    scenario = skyarm.load_scenario(case, plant=plant, duration=duration)
    known = suitable_options(law, loop_facts(scenario.rates, scenario.delays))
    made = make_controller(law, scenario.controller.par.model, **known, **options)
    return _digest(skyarm.run(dataclasses.replace(scenario, controller=made)))


def _digest(log: Any) -> str:
    return digest_of_arrays({name: getattr(log, name) for name in ARRAYS})


def fly_gust(shape: str, controller: str, plant: str) -> str:
    """Digest of a flight in noise, delay, dry friction and a gust."""
    return _digest(
        skyarm.run(
            skyarm.scenario_from(
                GUSTS[shape], replaced={"controller": controller, "plant": plant}
            )
        )
    )


def gust_name(shape: str, controller: str, plant: str) -> str:
    """Name of such a flight's digest."""
    return f"{shape} {as_taken(controller)} {plant}"


def gusts() -> Iterator[tuple[str, str, str]]:
    """(shape, controller, plant) of every such flight."""
    return product(GUSTS, GUSTED, PLANTS)


DOCUMENT: dict[str, Any] = {
    "schema": 1,
    "name": "digest",
    "duration": SECONDS,
    "plant": {
        "vehicle": "hummingbird_arm2_rotors",
        "joints": {"damping": 0.01, "coulomb": 0.002, "coulomb_rate": 0.05},
    },
    "model": {"vehicle": "hummingbird_arm2"},
    "controller": {"preset": "paper_ct"},
    "reference": {
        "base": {
            "kind": "circle",
            "center": [0.0, 0.0, 1.5],
            "radius": 0.3,
            "frequency_hz": 0.1,
            "start": 0.5,
        },
        "joints": [{"kind": "sine", "amplitude": 0.2, "frequency_hz": 0.3}, 0.1],
    },
    "environment": {
        "wind": {
            "mode": "moving_air",
            "velocity": [1.5, 0.5, 0.0],
            "turbulence": {"altitude": 10.0, "wind_20ft": 3.0},
        },
        "faults": [{"rotor": "front", "effectiveness": 0.9, "start": 3.0}],
    },
    "sensors": {"position": 0.001, "velocity": 0.01, "attitude": 0.002, "rate": 0.01},
    "delays": {"measurement": 0.005, "command": 0.002, "longest_command": 0.01},
    "seed": 7,
}
"""Noise, delays, moving air with turbulence, dry friction and a fault."""

GUSTS: dict[str, Any] = {
    shape: {
        **DOCUMENT,
        "name": shape,
        "environment": {
            "wind": {
                "mode": "moving_air",
                "velocity": [1.0, 0.5, 0.0],
                "gust": {
                    "velocity": [2.0, -1.0, 0.5],
                    "start": 1.503,
                    "duration": 2.5,
                    "shape": shape,
                },
            },
        },
    }
    for shape in ("one_minus_cosine", "step")
}
"""Moving air with a gust of each shape, which begins between two control instants."""

GUSTED = ("paper_ct", "centroidal_tip")

VARIED = {
    "plant.vehicle.base.mass": (0.6, 0.9),
    "plant.payload.mass": (0.0, 0.05),
    "environment.wind.velocity.0": (-2.0, 2.0),
    "delays.command": (0.0, 0.01),
    "reference.base.radius": (0.1, 0.4),
}


SHOWN = 8
"""Lanes whose metrics are kept for the fast modes."""

WINDOWS = Windows(
    steady=Window(2.0, 6.0),
    transient=Window(0.0, 2.0),
    gust=Window(1.0, 5.0),
    hover=Window(0.1, 0.45),
    holds=(Window(1.0, 2.0), Window(3.0, 4.0)),
    last=1.5,
)


LATER = (
    "x_error_max",
    "ee_time_outside",
    "reference_lag_mean",
    "reference_lag_max",
    "phases_done",
    "rotor_saturation",
    "joint_saturation",
)
"""Metrics that there were not yet when the digests were taken."""


def fly_batch(controller: str, mode: str) -> Any:
    """Digest of a batch in bit-exact code; in the fast modes, each metric of the first
    lanes.
    """
    scenario = skyarm.scenario_from(DOCUMENT, replaced={"controller": controller})
    kind = {"single": mode == "single", "bit_exact": mode == "bit_exact"}
    batch = Batch(
        scenario, list(VARIED), metrics=("all",), windows=WINDOWS, log_every=20, **kind
    )
    generator = np.random.default_rng(11)
    outcome = batch.fly(
        {path: generator.uniform(*ends, LANES) for path, ends in VARIED.items()}, seed=5
    )
    if mode != "bit_exact":
        return {
            name: [float(x) for x in values[:SHOWN]]
            for name, values in outcome.metrics.items()
        }
    kept = {
        name: values
        for name, values in outcome.metrics.items()
        if not name.startswith(LATER)
    }
    arrays = kept | {
        "status": outcome.status.astype("U32"),
        "end_time": outcome.end_time,
    }
    log = outcome.log
    for name, record in (
        ("last", outcome.state),
        ("state", log.state),
        ("command", log.command),
    ):
        arrays |= {
            f"{name}{i}": np.asarray(leaf) for i, leaf in enumerate(leaves(record))
        }
    return digest_of_arrays(arrays)


def main(path: str) -> None:
    """Fly everything and write it; what the file holds already is kept, so that a cut
    run goes on.
    """
    file = Path(path)
    found: dict[str, Any] = (
        json.loads(file.read_text())
        if file.exists()
        else {"flights": {}, "batches": {}}
    )
    found["versions"] = {
        "mujoco-core": metadata.version("mujoco-core"),
        "numpy": metadata.version("numpy"),
    }
    found["linear_algebra"] = linear_algebra()
    for controller in BATCHED:
        for mode in MODES:
            found["batches"].setdefault(
                f"{as_taken(controller)} {mode}", fly_batch(controller, mode)
            )
    for each in gusts():
        found.setdefault("gusts", {}).setdefault(gust_name(*each), fly_gust(*each))
    for case, controller, plant in flights():
        name = f"{plant} {as_taken(controller)} {case}"
        if name not in found["flights"]:
            found["flights"][name] = fly(case, controller, plant)
            print(name, flush=True)
            file.write_text(json.dumps(found, indent=0) + "\n")


if __name__ == "__main__":
    main(sys.argv[1])
