"""Reference of a plan: signals through the nodes of its file, its centre of mass with
derivatives, and wrong files.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.records.files import Fields
from skyarm.reference import Trajectory
from skyarm.reference.planned_motion import FORMAT, plan_tables, read_plan_arrays
from skyarm.reference.reference_tables import reference_from
from skyarm.reference.task_records import Setting

TIMES = np.linspace(0.0, 2.0, 41)
WITHIN = "must be finite numbers, from -1e+06 to 1e+06"


def arrays(**changes: Any) -> dict[str, Any]:
    """Arrays of a plan's file: every signal a smooth function of its own."""
    columns = {
        name: np.stack([np.sin(TIMES + k + 3 * j) for k in range(3)], axis=1)
        for j, name in enumerate(("position", "center", "tip"))
    }
    columns |= {
        name: np.stack([np.cos(TIMES * k) for k in range(1, 5)], axis=1)
        for name in ("quaternion", "rotor_speeds")
    }
    whole = {
        "format": FORMAT,
        "t": TIMES,
        "yaw": 0.1 * TIMES**2,
        "joints": columns["tip"][:, :2],
        **columns,
    } | changes
    return {name: value for name, value in whole.items() if value is not None}


def reference(
    folder: Path, content: dict[str, Any] | None = None, **entries: Any
) -> Trajectory:
    """Trajectory of a table [reference] of kind "plan" with a file of these arrays."""
    file = folder / "plan.npz"
    np.savez(file, **(arrays() if content is None else content))
    table = {"kind": "plan", "file": str(file), **entries}
    return reference_from(table, 2, "reference", Setting())


def test_the_reference_is_at_the_nodes_of_the_plan_from_its_start_on(
    tmp_path: Path,
) -> None:
    whole, trajectory = arrays(), reference(tmp_path, start=1.5)
    for k in (0, 7, 20, 40):
        sample = trajectory.at(1.5 + TIMES[k])
        np.testing.assert_allclose([*sample.position], whole["position"][k], atol=1e-12)
        np.testing.assert_allclose([*sample.joints], whole["joints"][k], atol=1e-12)
        np.testing.assert_allclose(sample.yaw, whole["yaw"][k], atol=1e-12)
        np.testing.assert_allclose([*sample.tip][:3], whole["tip"][k], atol=1e-12)
        np.testing.assert_allclose([*sample.center][:3], whole["center"][k], atol=1e-12)
        np.testing.assert_allclose(
            sample.turning[:8],
            [*whole["quaternion"][k], *whole["rotor_speeds"][k]],
            atol=1e-12,
        )
    before, after = trajectory.at(0.2), trajectory.at(9.0)
    np.testing.assert_allclose([*before.position], whole["position"][0], atol=1e-12)
    np.testing.assert_allclose([*after.position], whole["position"][-1], atol=1e-12)


def test_the_centre_of_mass_comes_with_four_derivatives(tmp_path: Path) -> None:
    trajectory = reference(tmp_path)
    rows = np.reshape([float(c) for c in trajectory.at(1.02).center], (5, 3))
    # of sin(t + k + 3), which a spline through 41 nodes follows
    place = 1.02 + np.arange(3) + 3.0
    exact = [
        np.sin(place),
        np.cos(place),
        -np.sin(place),
        -np.cos(place),
        np.sin(place),
    ]
    for order, tolerance in enumerate((1e-6, 1e-5, 1e-3)):
        np.testing.assert_allclose(rows[order], exact[order], atol=tolerance)
    h = 1e-5
    ahead, behind = (
        np.reshape([float(c) for c in trajectory.at(1.02 + s).center], (5, 3))
        for s in (h, -h)
    )
    np.testing.assert_allclose((ahead - behind)[:4] / (2.0 * h), rows[1:], atol=1e-5)


def test_a_plan_of_a_vehicle_without_a_tip(tmp_path: Path) -> None:
    trajectory = reference(tmp_path, arrays(tip=np.zeros((41, 0))))
    assert trajectory.planned is not None
    assert not trajectory.planned.tip
    assert len([*trajectory.at(0.5).center]) == 15


@pytest.mark.parametrize(
    ("changes", "entries", "message"),
    [
        ({"rotor_speeds": None}, {}, "must be a file of 'skyarm plan' of this version"),
        ({"center": None}, {}, "must be a file of 'skyarm plan' of this version"),
        ({"format": FORMAT + 1}, {}, "must be a file of 'skyarm plan' of this version"),
        ({}, {"start": -1.0}, "reference.start = -1.0: must be at least 0"),
        (
            {},
            {"base": {"kind": "hover"}},
            "reference.base = {'kind': 'hover'}: must be left out beside a plan",
        ),
        ({}, {"joints": []}, "reference.joints = []: must be left out beside a plan"),
        ({}, {"planned": {}}, "reference.planned = {}: must be left out beside a plan"),
    ],
)
def test_wrong_tables_are_refused(
    tmp_path: Path, changes: Any, entries: Any, message: str
) -> None:
    with pytest.raises(ValueError, match=r"^reference\.") as refused:
        reference(tmp_path, arrays(**changes), **entries)
    assert str(refused.value).endswith(message)
    assert "\n" not in str(refused.value)


def with_(name: str, value: float) -> np.ndarray[Any, Any]:
    """An array of the plan whose row 7 is a value."""
    changed = np.array(arrays()[name], dtype=float)
    changed[7] = value
    return changed


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"quaternion": np.ones((41, 3))},
            "quaternion of shape (41, 3): must be (41, 4)",
        ),
        ({"quaternion": np.ones(41)}, "quaternion of shape (41,): must be (41, 4)"),
        (
            {"quaternion": with_("quaternion", 0.0)},
            "quaternion: must be of length 1 at each node",
        ),
        ({"quaternion": with_("quaternion", np.nan)}, f"quaternion: {WITHIN}"),
        ({"position": np.ones((40, 3))}, "position of shape (40, 3): must be (41, 3)"),
        (
            {"position": np.array(["a"] * 41)},
            "position of type <U1: must be an array of numbers",
        ),
        (
            {"position": np.ones((41, 3)) * 1j},
            "position of type complex128: must be an array of numbers",
        ),
        ({"center": np.ones((41, 2))}, "center of shape (41, 2): must be (41, 3)"),
        ({"tip": np.ones((41, 2))}, "tip of shape (41, 2): must be (41, 3)"),
        ({"yaw": np.ones((41, 1))}, "yaw of shape (41, 1): must be (41,)"),
        ({"yaw": with_("yaw", np.inf)}, f"yaw: {WITHIN}"),
        ({"joints": np.ones(41)}, "joints of shape (41,): must be (41, any number)"),
        (
            {"rotor_speeds": np.ones((3, 4))},
            "rotor_speeds of shape (3, 4): must be (41, any number)",
        ),
        ({"torques": np.ones((41, 3))}, "torques of shape (41, 3): must be (41, 2)"),
        ({"torques": with_("joints", np.nan)}, f"torques: {WITHIN}"),
        ({"force": np.ones((41, 2))}, "force of shape (41, 2): must be (41, 3)"),
        ({"t": 1.0}, "t of shape (): must be a list of two times or more"),
        ({"t": TIMES[:1]}, "t of shape (1,): must be a list of two times or more"),
        ({"t": TIMES[::-1]}, "t: must increase from node to node"),
        ({"t": with_("t", np.nan)}, f"t: {WITHIN}"),
        ({"t": with_("t", 1e300)}, f"t: {WITHIN}"),
        ({"position": with_("position", -1e300)}, f"position: {WITHIN}"),
        ({"rotor_speeds": with_("rotor_speeds", 1e300)}, f"rotor_speeds: {WITHIN}"),
        # which no reference reads
        ({"gains": np.full((40, 4, 6), np.nan)}, f"gains: {WITHIN}"),
        ({"inputs": np.full((40, 4), 1e300)}, f"inputs: {WITHIN}"),
        (
            {"gains": np.array(["a"] * 40)},
            "gains of type <U1: must be an array of numbers",
        ),
        (
            {"gains": np.ones((40, 4))},
            "gains of shape (40, 4): must be (40, any number, any number)",
        ),
        (
            {"inputs": np.ones((41, 4))},
            "inputs of shape (41, 4): must be (40, any number)",
        ),
        ({"inputs": 1.0}, "inputs of shape (): must be (40, any number)"),
        ({"velocity": np.ones((41, 2))}, "velocity of shape (41, 2): must be (41, 3)"),
        ({"rate": "fast"}, "rate of type <U4: must be an array of numbers"),
        (
            {"joint_rates": np.ones((41, 3))},
            "joint_rates of shape (41, 3): must be (41, 2)",
        ),
        ({"phase": np.ones((41, 1))}, "phase of shape (41, 1): must be (41,)"),
        (
            {"phase": np.array([b"a"] * 41)},
            "phase of type |S1: must be an array of numbers",
        ),
        (
            {"position": np.full((41, 3), np.iinfo(np.int64).min)},
            "position: must be finite numbers, from -1e+06 to 1e+06",
        ),
        (
            {"rate": np.full((41, 3), np.inf, dtype=np.float16)},
            "rate: must be finite numbers, from -1e+06 to 1e+06",
        ),
        (
            {"t": np.arange(41, 0, -1, dtype=np.uint8)},
            "t: must increase from node to node",
        ),
        ({"notes": "mine"}, "notes of type <U4: must be an array of numbers"),
        ({"vehicle": 3}, "vehicle: must be a name"),
        ({"format": np.ones(3)}, "must be a file of 'skyarm plan' of this version"),
        ({"format": "one"}, "must be a file of 'skyarm plan' of this version"),
    ],
)
def test_wrong_arrays_are_refused(tmp_path: Path, changes: Any, message: str) -> None:
    with pytest.raises(ValueError, match=r"^reference\.file = ") as refused:
        reference(tmp_path, arrays(**changes))
    assert str(refused.value).endswith(f"plan.npz': {message}")
    assert "\n" not in str(refused.value)


def test_a_plan_is_flown_by_its_own_vehicle_alone(tmp_path: Path) -> None:
    file = tmp_path / "plan.npz"
    fields = {"kind": "plan", "file": str(file)}
    np.savez(file, **arrays(vehicle="eagle"))
    assert plan_tables(Fields(fields, "reference"), "eagle") == plan_tables(
        Fields(fields, "reference")
    )
    other = Setting(vehicle=skyarm.load_vehicle("hummingbird"))
    with pytest.raises(
        ValueError,
        match=r"^reference\.file = .*: is a plan of 'eagle'; plant.vehicle is 'humm",
    ) as no:
        reference_from(fields, 0, "reference", other)
    assert "\n" not in str(no.value)
    # files of before do not name it
    np.savez(file, **arrays())
    assert reference_from(fields, 2, "reference", other).planned is not None


@pytest.mark.parametrize("content", [b"", b"no archive", b"PK\x03\x04 cut off"])
def test_files_that_are_no_plan_are_refused(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "p.npz"
    file.write_bytes(content)
    with pytest.raises(
        ValueError, match=r"p\.npz'.*: must be a file of 'skyarm plan'$"
    ):
        read_plan_arrays(str(file), f"reference.file = '{file}'")
    with pytest.raises(ValueError, match=r"^reference\.file = .*none\.npz"):
        plan_tables(
            Fields({"kind": "plan", "file": str(tmp_path / "none.npz")}, "reference")
        )


def test_an_array_alone_or_a_damaged_archive_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "p.npz"
    whole = io.BytesIO()
    np.savez_compressed(whole, **arrays())
    alone = io.BytesIO()
    np.save(alone, TIMES)
    damaged = bytearray(whole.getvalue())
    damaged[200:260] = bytes(60)
    for content in (alone.getvalue(), bytes(damaged)):
        file.write_bytes(content)
        with pytest.raises(
            ValueError, match=r"^reference\.file: must be a file of 'skyarm plan'$"
        ):
            read_plan_arrays(str(file), "reference.file")
