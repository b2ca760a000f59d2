"""No change of the house changes a flight: digests of logs, taken before it was opened.

All 460 flights and 21 batches are compared by ``make digests`` (some twenty minutes);
here a few of each, and those in gusts.
"""

from __future__ import annotations

import json
import math
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest

from support import flight_digests as digests
from support.cases import sampled

HELD: dict[str, Any] = json.loads(
    (Path(__file__).parents[1] / "data" / "flight_digests.json").read_text("utf-8")
)

FEW = (
    ("case1", "paper_pd", "rigid_body"),
    ("case2_gust", "centroidal_joint", "rigid_body"),
    ("case3", "l1_adaptive", "rigid_body"),
    ("case3_wind", "centroidal_tip", "rigid_body"),
    ("case3_wind", "paper_ct", "mujoco"),
)

BLAS = ("nmpc", "nmpc_tuned")
"""Laws whose numbers are NumPy's linear algebra's, which may round otherwise on another
processor.

So are those of the accelerometer on MuJoCo's plant, which the centroidal law hears.
"""

OTHER = (
    "the digests were taken with another version of MuJoCo or another linear algebra"
)


def same_machinery(controller: str, plant: str) -> bool:
    """Whether the libraries whose rounding a flight shows are those of the digests."""
    if (
        plant == "mujoco"
        and metadata.version("mujoco-core") != HELD["versions"]["mujoco-core"]
    ):
        return False
    hears = plant == "mujoco" and controller.startswith("centroidal")
    return (
        not (hears or controller in BLAS)
        or digests.linear_algebra() == HELD["linear_algebra"]
    )


def compare(case: str, controller: str, plant: str) -> None:
    if not same_machinery(controller, plant):
        pytest.skip(OTHER)
    assert (
        digests.fly(case, controller, plant)
        == HELD["flights"][f"{plant} {digests.as_taken(controller)} {case}"]
    )


@pytest.mark.parametrize(("case", "controller", "plant"), FEW)
def test_a_flight_is_what_it_was(case: str, controller: str, plant: str) -> None:
    compare(case, controller, plant)


GUSTS = list(digests.gusts())
HALF = [gust for k, gust in enumerate(GUSTS) if k.bit_count() % 2 == 0]
"""Of two shapes, two laws and two plants every pair meets once."""


@pytest.mark.parametrize(
    ("shape", "controller", "plant"), sampled(GUSTS, len(GUSTS), keep=HALF)
)
def test_a_flight_in_a_gust_is_what_it_was(
    shape: str, controller: str, plant: str
) -> None:
    if not same_machinery(controller, plant):
        pytest.skip(OTHER)
    assert (
        digests.fly_gust(shape, controller, plant)
        == HELD["gusts"][digests.gust_name(shape, controller, plant)]
    )


def require_batch(controller: str, mode: str) -> None:
    """Bit-exact code: the digest. Fast modes: every metric within 1e-9, or 1e-4 in
    single precision, relative.
    """
    found, held = (
        digests.fly_batch(controller, mode),
        HELD["batches"][f"{digests.as_taken(controller)} {mode}"],
    )
    if mode == "bit_exact":
        assert found == held
        return
    bound = 1e-9 if mode == "double" else 1e-4
    assert set(held) <= set(found)
    for name, values in held.items():
        for new, old in zip(found[name], values, strict=True):
            both_missing = math.isnan(new) and math.isnan(old)
            assert both_missing or new == pytest.approx(old, rel=bound, abs=bound), (
                name,
                new,
                old,
            )


@pytest.mark.parametrize("mode", digests.MODES)
def test_a_batch_is_what_it_was(mode: str) -> None:
    require_batch("paper_ct", mode)


@pytest.mark.digests
@pytest.mark.parametrize(("case", "controller", "plant"), list(digests.flights()))
def test_every_flight_is_what_it_was(case: str, controller: str, plant: str) -> None:
    compare(case, controller, plant)


@pytest.mark.digests
@pytest.mark.parametrize("controller", digests.BATCHED)
@pytest.mark.parametrize("mode", digests.MODES)
def test_every_batch_is_what_it_was(controller: str, mode: str) -> None:
    require_batch(controller, mode)
