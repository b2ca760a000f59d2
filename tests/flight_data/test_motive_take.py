"""Takes of Motive, whose world has y up, beside SciPy's rotations."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skyarm.flight_data.columns_file import columns_from
from skyarm.flight_data.flight_data import FlightData, load_flight

UPRIGHT = Rotation.from_matrix([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
"""From a world with z up to Motive's: x is x, y is up, z is to the right of x."""

SAID = (
    "pose: y up is assumed, as the take states no axes; export one that has z up anew,"
    " with y up."
)

LAST = "Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,"
GROUPS = (
    ",,Rotation,Rotation,Rotation,Rotation,Position,Position,Position,Mean Marker Error"
)


def take(
    turns: dict[str, Rotation],
    places: np.ndarray,
    unit: str = "Meters",
    kind: str = "Quaternion",
    late: float = 7.3,
) -> str:
    """Text of a take of rigid bodies at given attitudes and places in a world with z
    up.
    """
    factor = {"Meters": 1.0, "Millimeters": 1000.0}.get(unit, 1.0)
    where = factor * UPRIGHT.apply(places)
    cells = [
        np.hstack([(UPRIGHT * each * UPRIGHT.inv()).as_quat(), where])
        for each in turns.values()
    ]
    rows = [
        f"{k},{late + 0.01 * k:.6f},"
        + "".join(f"{','.join(map(repr, each[k].tolist()))},0.1," for each in cells)
        for k in range(len(places))
    ]
    bodies = list(turns)
    return "\n".join(
        [
            (
                f"Format Version,1.23,Take Name,a take,Rotation Type,{kind},Length"
                f" Units,{unit},Coordinate Space,Global"
            ),
            "",
            ",Type" + ",Rigid Body" * 8 * len(bodies),
            ",Name" + "".join(f",{each}" * 8 for each in bodies),
            ",ID" + ',"00"' * 8 * len(bodies),
            GROUPS + GROUPS[1:] * (len(bodies) - 1),
            LAST + LAST[19:] * (len(bodies) - 1),
            *(row.removesuffix(",") for row in rows),
        ]
    )


def read(folder: Path, text: str) -> FlightData:
    (folder / "take.csv").write_text(text, encoding="utf-8-sig", newline="")
    return load_flight(folder / "take.csv")


@pytest.fixture
def motion() -> tuple[Rotation, np.ndarray]:
    draw = np.random.default_rng(0)
    return Rotation.from_rotvec(
        np.cumsum(0.1 * draw.normal(size=(50, 3)), axis=0)
    ), draw.normal(size=(50, 3))


@pytest.mark.parametrize("unit", ["Meters", "Millimeters"])
@pytest.mark.parametrize("ends", ["\n", "\r\n"])
def test_a_take_is_the_pose_in_a_world_with_z_up(
    tmp_path: Path, motion: tuple[Rotation, np.ndarray], unit: str, ends: str
) -> None:
    found = read(
        tmp_path, take({"quad": motion[0]}, motion[1], unit).replace("\n", ends)
    )
    np.testing.assert_allclose(found["position"].values, motion[1], atol=1e-9)
    wanted = motion[0].as_quat()[:, [3, 0, 1, 2]]
    np.testing.assert_allclose(
        np.abs(np.sum(found["quaternion"].values * wanted, axis=1)), 1.0, atol=1e-9
    )
    np.testing.assert_allclose(found["position"].time, 0.01 * np.arange(50), atol=1e-9)
    assert found.facts["start"] == pytest.approx(7.3)
    assert (found.notes, found.facts["vehicle"]) == ((SAID,), "quad")


def test_of_several_bodies_the_first_is_read_or_that_of_a_mapping(
    tmp_path: Path, motion: tuple[Rotation, np.ndarray]
) -> None:
    text = take({"quad": motion[0], "box": Rotation.identity(50)}, motion[1])
    found = read(tmp_path, text)
    assert found.facts["vehicle"] == "quad"
    listed = (
        "file: holds flights of quad, box; the first is read, #1; write FILE#1 for the"
        " first."
    )
    assert found.notes == (SAID, listed)
    second = load_flight(f"{tmp_path}/take.csv#2")
    assert (second.facts["vehicle"], second.notes) == ("box", (SAID,))
    np.testing.assert_allclose(
        second["quaternion"].values, [[1, 0, 0, 0]] * 50, atol=1e-9
    )
    names = [f"box: Rotation {each}" for each in "WXYZ"]
    other = load_flight(
        tmp_path / "take.csv", columns_from({"quaternion": {"columns": names}})
    )
    np.testing.assert_allclose(
        other["quaternion"].values, [[1, 0, 0, 0]] * 50, atol=1e-9
    )


def test_a_body_may_have_a_colon_in_its_name_and_the_first_of_equal_names_is_read(
    tmp_path: Path, motion: tuple[Rotation, np.ndarray]
) -> None:
    text = take({"lab: quad": motion[0], "other": Rotation.identity(50)}, motion[1])
    for each in (text, text.replace("other", "lab: quad")):
        found = read(tmp_path, each)
        assert found.facts["vehicle"] == "lab: quad"
        wanted = motion[0].as_quat()[:, [3, 0, 1, 2]]
        np.testing.assert_allclose(
            np.abs(np.sum(found["quaternion"].values * wanted, axis=1)), 1.0, atol=1e-9
        )


def test_rows_in_which_the_body_is_not_seen_are_left_out(
    tmp_path: Path, motion: tuple[Rotation, np.ndarray]
) -> None:
    lines = take({"quad": motion[0]}, motion[1]).split("\n")
    lines[27] = "20,7.500000,,,,,,,,"
    found = read(tmp_path, "\n".join(lines))
    assert found["position"].time.size == 49
    assert "position: 1 of 50 rows are without numbers and are left out." in found.notes


def test_takes_that_hold_no_pose_are_one_line_with_what_to_export(
    tmp_path: Path, motion: tuple[Rotation, np.ndarray]
) -> None:
    good = take({"quad": motion[0]}, motion[1])
    for text, words in (
        (
            take({"quad": motion[0]}, motion[1], kind="XYZ"),
            "head = .*'XYZ'.*: export it anew, with quaternions",
        ),
        (
            take({"quad": motion[0]}, motion[1], unit="Inches"),
            "head = .*: export it anew, with quaternions and lengths",
        ),
        (good.replace("Rigid Body", "Marker"), "columns: none is of a Rigid Body"),
        (good[: good.index("Frame,")], "head: must have a line that begins with Frame"),
        (good[: good.index("\n0,")], "channels = none|rows = 0"),
    ):
        with pytest.raises(ValueError, match=words) as error:
            read(tmp_path, text)
        assert "\n" not in str(error.value)
