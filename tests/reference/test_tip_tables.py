"""References of the tip from tables: the base carries the tip exactly; wrong tables get
one line.
"""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import skyarm
from skyarm.algebra import Mat3, Vec3
from skyarm.dynamics.array_front import frame_pose_world
from skyarm.reference import tip_plan
from skyarm.reference.feasibility import _weakest, feasibility
from skyarm.reference.reference_tables import reference_from
from skyarm.reference.splines import snap_cost, snap_pieces, span_powers
from skyarm.reference.task_records import Setting
from skyarm.reference.waypoints import (
    LIMITS,
    FlightLimits,
    _cost,
    allocate,
    peaks,
    sample_derivatives,
    through,
)

ARM2, ARM6 = (
    skyarm.load_vehicle(name) for name in ("hummingbird_arm2_rotors", "hexarotor_arm6")
)
TWO, SIX = (
    Setting(vehicle=v, duration=4.0, thrust_to_weight=2.5) for v in (ARM2, ARM6)
)
CIRCLE = {
    "kind": "circle",
    "radius": 0.2,
    "frequency_hz": 0.2,
    "center": [0.0, 0.1, 0.7],
}
TURNING = {"kind": "sine", "amplitude": 0.4, "frequency_hz": 0.1}
POSTURE6 = [0.0, 0.6, -1.0, 0.0, 0.5, 0.0]
WORLD = {
    "yaw": TURNING,
    "tip": {"path": CIRCLE, "posture": POSTURE6, "base_share": 0.4},
}
TIMES = np.linspace(0.0, 3.9, 40)


@pytest.fixture(scope="module")
def shared():
    return reference_from(WORLD, 6, "reference", SIX)


def level_tip(vehicle, reference, k):
    """Tip of the level base of a reference's sample, by arrays."""
    turn = Rotation.from_euler("z", reference.yaw).as_quat(scalar_first=True)
    return frame_pose_world(
        vehicle, np.array([*reference.position]), turn, np.array(reference.joints)
    )[k]


def test_the_level_base_carries_the_tip_exactly_where_it_is_wanted(shared):
    for t in TIMES:
        at = shared.at(t)
        angle = 2.0 * np.pi * 0.2 * t
        wanted = [0.2 * np.cos(angle), 0.1 + 0.2 * np.sin(angle), 0.7]
        np.testing.assert_allclose(at.tip, wanted, atol=1e-14)
        np.testing.assert_allclose(level_tip(ARM6, at, 0), wanted, atol=1e-14)


def test_each_derivative_of_the_base_is_the_difference_of_the_one_below(shared):
    names, h = ("position", "velocity", "acceleration", "jerk", "snap"), 1e-3
    for t in (0.77, 2.03):  # within pieces of the plan
        ahead, behind = shared.at(t + h), shared.at(t - h)
        for below, above in itertools.pairwise(names):
            slope = (np.array([*getattr(ahead, below)]) - [*getattr(behind, below)]) / (
                2.0 * h
            )
            # central difference: h^2/6 of the derivative two orders above, up to 200
            # m/s^6 in the joints' curves
            np.testing.assert_allclose(
                [*getattr(shared.at(t), above)], slope, atol=5e-5
            )


def test_a_nearly_singular_arm_is_told_with_its_singular_value(shared):
    def tip_at(joints):
        return frame_pose_world(
            ARM6, np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), joints
        )[0]

    good = feasibility(shared, SIX)
    assert not [line for line in good.warnings() if "singular" in line]
    q = np.array([float(c) for c in shared.at(good.weakest_at).joints])
    J = np.stack(
        [(tip_at(q + h) - tip_at(q - h)) / 2e-6 for h in 1e-6 * np.eye(6)], axis=1
    )
    assert good.weakest == pytest.approx(
        np.linalg.svd(J, compute_uv=False)[-1], rel=1e-6
    )
    # stretched straight down the arm neither lengthens nor turns its tip about the
    # vertical
    straight = reference_from(
        {"tip": WORLD["tip"] | {"posture": [0.0] * 6, "base_share": 1.0}},
        6,
        "reference",
        SIX,
    )
    found = feasibility(straight, SIX)
    assert found.weakest < 1e-3
    assert any(
        "the arm is nearly singular at 0 s; in one direction it moves" in line
        for line in found.warnings()
    )


def test_across_its_plane_a_planar_arm_of_three_joints_is_not_singular():
    """Three parallel joints move no tip sideways in any posture; stretched they lose a
    direction of their plane.
    """
    times, pitches = np.zeros(1), [1, 2, 4]
    bent, straight = (
        np.array([[0.0], [-0.6], [-0.97], [0.0], [-0.8], [0.0]]),
        np.zeros((6, 1)),
    )
    level = np.array([1.0, 0.0, 0.0, 0.0])
    J = skyarm.frame_jacobian(ARM6, np.zeros(3), level, bent[:, 0])[[0, 2]][
        :, [6 + k for k in pitches]
    ]
    assert _weakest(ARM6, pitches, times, bent) == (
        pytest.approx(np.linalg.svd(J, compute_uv=False)[1], rel=1e-9),
        0.0,
    )
    assert _weakest(ARM6, pitches, times, bent)[0] > 0.05
    assert _weakest(ARM6, pitches, times, straight)[0] < 1e-6
    # a joint frame of a file that writes a right angle as 1.5708 or 1.571 rad
    for wrong in (1.5708, 1.571):
        link = ARM6.links[2]
        turned = Mat3(
            *(
                Vec3(*row)
                for row in Rotation.from_euler("x", wrong - math.pi / 2).as_matrix()
            )
        )
        frame = dataclasses.replace(link.joint, rotation=link.joint.rotation @ turned)
        links = tuple(
            dataclasses.replace(each, joint=frame) if each is link else each
            for each in ARM6.links
        )
        assert (
            _weakest(dataclasses.replace(ARM6, links=links), pitches, times, bent)[0]
            > 0.05
        )


def test_base_and_arm_share_the_way(shared):
    base = np.array([[*shared.at(t).position][:2] for t in TIMES])
    # half a turn is a way of 0.4 m; 0.6 of it is the arm's, 0.24 m, which arm_range =
    # 0.1 m bounds
    assert np.ptp(base[:, 0]) == pytest.approx(
        0.4 - 0.24 / np.sqrt(1.0 + 2.4**2), rel=5e-3
    )
    alone = reference_from(
        {"tip": WORLD["tip"] | {"base_share": 1.0}}, 6, "reference", SIX
    )
    assert {alone.at(t).joints for t in TIMES} == {tuple(POSTURE6)}


def test_a_table_of_times_has_the_bits_of_single_times(shared):
    table = shared.at(TIMES)
    single = [shared.at(float(t)) for t in TIMES]
    for i, q in enumerate(table.joints):
        np.testing.assert_array_equal(
            np.broadcast_to(q, TIMES.shape), [each.joints[i] for each in single]
        )


def test_the_tip_keeps_an_orientation():
    table = {
        "yaw": 0.1,
        "tip": {
            "path": CIRCLE,
            "posture": POSTURE6,
            "orientation": [0.0, 0.3, TURNING],
        },
    }
    found = reference_from(table, 6, "reference", SIX)
    for t in TIMES:
        at = found.at(t)
        wanted = Rotation.from_euler("ZYX", [0.4 * np.sin(0.2 * np.pi * t), 0.3, 0.0])
        turn = Rotation.from_matrix(level_tip(ARM6, at, 1))
        assert (wanted.inv() * turn).magnitude() < 2e-3


def test_roll_pitch_and_yaw_turn_as_scipy_turns():
    for roll, pitch, yaw in ((0.3, -0.5, 1.2), (-1.0, 0.9, -2.0)):
        R = np.array([tuple(row) for row in tip_plan._turn(roll, pitch, yaw).rows])
        np.testing.assert_allclose(
            R, Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix(), atol=1e-15
        )


def test_a_joint_at_its_limit_is_told():
    narrow = dataclasses.replace(ARM6.links[1].joint, upper=0.61, lower=-2.0)
    links = (
        ARM6.links[0],
        dataclasses.replace(ARM6.links[1], joint=narrow),
        *ARM6.links[2:],
    )
    held = Setting(
        vehicle=dataclasses.replace(ARM6, links=links),
        duration=4.0,
        thrust_to_weight=2.5,
    )
    plan = reference_from(WORLD, 6, "reference", held)
    joints = np.array([plan.at(t).joints for t in TIMES])
    assert joints[:, 1].max() <= 0.61
    ((name, seconds),) = feasibility(plan, held).at_limits
    at_limit = np.mean(
        [plan.at(t).joints[1] > 0.608 for t in np.linspace(0.0, 4.0, 250)]
    )
    assert (name, seconds) == (narrow.name, pytest.approx(4.0 * at_limit, abs=0.05))


@pytest.mark.thorough
def test_a_joint_that_does_not_carry_the_tip_may_rest_at_its_limit():
    last, second = ARM6.links[-1], ARM6.links[1]
    narrow = dataclasses.replace(
        second, joint=dataclasses.replace(second.joint, upper=0.61, lower=-2.0)
    )
    alone = dataclasses.replace(ARM6, links=(ARM6.links[0], narrow, *ARM6.links[2:]))
    joint = dataclasses.replace(last.joint, name="finger", lower=0.0, upper=0.04)
    finger = dataclasses.replace(last, name="finger", joint=joint, parent=-1)
    links = (
        dataclasses.replace(link, parent=link.parent + 1 if link.parent >= 0 else -1)
        for link in alone.links
    )
    frames = tuple(
        dataclasses.replace(frame, link=frame.link + 1) for frame in ARM6.frames
    )
    found = []
    for vehicle, posture in (
        (alone, POSTURE6),
        (
            dataclasses.replace(alone, links=(finger, *links), frames=frames),
            [0.0, *POSTURE6],
        ),
    ):
        held = Setting(vehicle=vehicle, duration=4.0, thrust_to_weight=2.5)
        table = {"tip": WORLD["tip"] | {"posture": posture}}
        found.append(
            feasibility(
                reference_from(table, vehicle.n, "reference", held), held
            ).at_limits
        )
    assert [name for name, _ in found[0]] == [narrow.joint.name]
    assert [name for name, _ in found[1]] == [narrow.joint.name]
    assert [seconds for _, seconds in found[1]] == pytest.approx(
        [seconds for _, seconds in found[0]], abs=0.05
    )


@pytest.mark.thorough
def test_no_joint_is_planned_faster_than_it_may_be():
    table = {"tip": WORLD["tip"] | {"joint_speed": 0.1}}
    plan = reference_from(table, 6, "reference", SIX)
    speeds = np.abs([plan.at(t).joint_rates for t in TIMES])
    assert 0.099 < speeds.max() <= 0.1 + 1e-12


def test_the_body_rate_is_that_at_which_the_thrust_turns():
    points, times = [(0.0, 0.0, 1.0), (1.0, 0.5, 1.2), (2.0, 0.0, 1.0)], (0.0, 1.5, 3.0)
    motion, h = through(points, times), 1e-5
    found = peaks(sample_derivatives(motion, times), 9.81)

    def up(t):
        force = np.add([*motion.at(t).acceleration], [0.0, 0.0, 9.81])
        return force / np.linalg.norm(force)

    inside = np.linspace(0.0, 3.0, 400)[1:-1]
    rates = [np.linalg.norm(up(t + h) - up(t - h)) / (2.0 * h) for t in inside]
    assert found.rate == pytest.approx(max(rates), rel=1e-3)
    assert found.tilt == pytest.approx(
        max(np.arccos(up(t)[2]) for t in inside), rel=1e-3
    )


def test_the_fastest_motion_meets_a_limit_and_no_faster_one_does():
    points = [(0.0, 0.0, 1.0), (1.0, 0.5, 1.2), (2.0, 0.0, 1.0), (2.0, 2.0, 1.5)]
    for limits in (
        FlightLimits(),
        FlightLimits(speed=9.0, acceleration=9.0, spin=90.0),
        FlightLimits(speed=0.5),
    ):
        times = allocate(points, limits, 9.81)
        found = peaks(sample_derivatives(through(points, times), times), 9.81)
        assert found.within(limits)
        assert any(
            getattr(found, name) > 0.999 * getattr(limits, name) for name in LIMITS
        )
    # the pieces' shares make the snap less than shares by length do
    even = [0.0]
    for a, b in itertools.pairwise(points):
        even.append(even[-1] + np.linalg.norm(np.subtract(b, a)))
    even = [t * times[-1] / even[-1] for t in even]
    assert snap(points, times) < snap(points, even)


def test_the_thrust_turns_no_faster_where_the_motion_stops():
    """The angular acceleration of the thrust's direction, by differences: it can be
    the largest in the last instant, where the snap ends.
    """
    points = [
        (-0.8, 0.4, -1.8),
        (0.3, 0.8, 1.0),
        (-1.9, -1.7, 1.2),
        (1.5, 1.6, 0.2),
    ]
    limits = FlightLimits(
        speed=1e3, acceleration=1e3, tilt=1.4, rate=1e3, spin=3.0, thrust=1e3
    )
    times = allocate(points, limits, 9.81)
    motion, h = through(points, times), 1e-4

    def up(t):
        force = np.add([*motion.at(t).acceleration], [0.0, 0.0, 9.81])
        return force / np.linalg.norm(force)

    last = times[-1] - h
    found = [
        np.linalg.norm(up(t + h) - 2.0 * up(t) + up(t - h)) / h**2
        for t in (*np.linspace(h, last, 300), last - h)
    ]
    assert 0.98 * limits.spin < max(found) < 1.02 * limits.spin


def test_shares_of_many_points_have_the_bits_of_one_spline_after_the_other():
    """Costs of all changed shares at once, and from each spline alone; the times are
    found once.
    """
    rng = np.random.default_rng(5)
    points = [
        tuple(each) for each in np.cumsum(rng.normal(size=(9, 3)), axis=0).tolist()
    ]
    shares = rng.dirichlet(np.ones(8)).tolist()
    cost, slopes = _cost(points, shares)

    def alone(given):
        spans = span_powers([*itertools.accumulate(given, initial=0.0)])
        return sum(
            snap_cost(spans, snap_pieces(spans, [p[axis] for p in points]))
            for axis in range(3)
        )

    moved = [
        alone([share * (1.0 + 1e-4 * (i == k)) for i, share in enumerate(shares)])
        for k in range(8)
    ]
    assert cost == alone(shares)
    assert slopes == [(each - cost) / 1e-4 for each in moved]
    assert allocate(points, FlightLimits(), 9.81) is allocate(
        [*points], FlightLimits(), 9.81
    )


def snap(points, times):
    """Mean square of the snap, by samples."""
    t = np.linspace(0.0, times[-1], 4001)[:-1]
    motion = through(points, times)
    return sum(
        float((axis.derivatives(t)[4] ** 2).mean())
        for axis in (motion.x, motion.y, motion.z)
    )


def test_phases_follow_each_other_from_rest_to_rest():
    phases = [
        {"kind": "hold", "duration": 1.0},
        {
            "kind": "go_to",
            "position": [1.0, 0.0, 1.0],
            "via": [[0.5, 0.3, 1.2]],
            "duration": 3.0,
        },
        {"kind": "pick", "payload": "box", "position": [1.0, 0.0, 0.6], "dwell": 2.0},
        {
            "kind": "place",
            "payload": "box",
            "position": [0.0, 0.0, 0.6],
            "approach": [0.0, 0.0, 0.2],
        },
    ]
    setting = dataclasses.replace(TWO, events=[])
    path = {"kind": "phases", "position": [0.0, 0.0, 1.0], "phases": phases}
    found = reference_from({"base": path}, 2, "reference", setting)
    assert [*found.at(0.9).position] == [0.0, 0.0, 1.0] == [*found.at(1.0).position]
    np.testing.assert_allclose([*found.at(4.0).position], [1.0, 0.0, 1.0], atol=1e-12)
    pick, place = setting.events
    assert (pick.kind, pick.payload, place.kind) == ("pick", "box", "place")
    for event, there in ((pick, [1.0, 0.0, 0.6]), (place, [0.0, 0.0, 0.6])):
        for t in (event.time - 0.4, event.time + 0.4):
            at = found.at(t)
            np.testing.assert_allclose([*at.position], there, atol=1e-12)
            np.testing.assert_allclose([*at.velocity], 0.0, atol=1e-12)
    np.testing.assert_allclose([*found.at(60.0).position], [0.0, 0.0, 0.8], atol=1e-12)


def test_samples_of_a_file_are_passed_at_their_times(tmp_path):
    file = tmp_path / "path.csv"
    file.write_text("note,t,x,y,z\na,0,0,0,1\nb,1,0.5,0.1,1.1\n\nc,2.5,0.7,0.4,1\n")
    column = {"kind": "samples", "file": str(file), "time": "t"}
    table = {
        "kind": "signals",
        **{name: column | {"column": name, "start": 1.0} for name in "xyz"},
    }
    found = reference_from(
        {"base": table, "yaw": column | {"column": "y"}}, 0, "reference", Setting()
    )
    np.testing.assert_allclose([*found.at(2.0).position], [0.5, 0.1, 1.1], atol=1e-12)
    assert found.at(1.0).yaw == pytest.approx(0.1)
    for text, message in (
        ("t,x,y,z\n0,0,0,1\n1,a,0,1\n", "row 2: x = 'a': must be a finite number"),
        ("t,x,y,z\n0,0,0,1\n1,0,0\n", "row 2: z = '': must be a finite number"),
        (
            "t,x,y,z\n0,0,0,1\n0,0,0,1\n",
            "row 2: t = 0.0: must be 0.001 s or more after 0.0 of the row before",
        ),
        (
            "t,x,y\n0,0,0\n1,1,1\n",
            "must have a column 'z' in its header; there are ['t', 'x', 'y']",
        ),
        ("t,x,y,z\n0,0,0,1\n", "must have 2 to 2000 rows below its header, not 1"),
        ("", "must have 2 to 2000 rows below its header, not 0"),
    ):
        file.write_text(text)
        with pytest.raises(ValueError, match=r"reference\.base\..\.file") as caught:
            reference_from({"base": table}, 0, "reference", Setting())
        assert message in str(caught.value)
        assert "\n" not in str(caught.value)


TIP = {"path": CIRCLE, "posture": [0.4, -0.8]}
WAYPOINTS = {"kind": "waypoints", "points": [[0, 0, 1], [1, 0, 1]]}
PHASES = {"kind": "phases", "position": [0, 0, 1]}
SAMPLES = {"kind": "samples", "column": "x"}


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"tip": 3}, "reference.tip = 3: must be a table"),
        ({"tip": {}}, "reference.tip.path: is missing"),
        (
            {"tip": TIP, "joints": [0, 0]},
            "reference.joints = [0, 0]: must be left out beside tip; see tip.posture",
        ),
        ({"tip": TIP, "base": CIRCLE}, "reference.base = "),
        (
            {"tip": TIP | {"posture": [0.0]}},
            "reference.tip.posture = 1 numbers: must be one for each of 2 joints",
        ),
        (
            {"tip": TIP | {"base_share": 1.5}},
            "reference.tip.base_share = 1.5: must be at most 1",
        ),
        (
            {"tip": TIP | {"base_share": -1}},
            "reference.tip.base_share = -1: must be at least 0",
        ),
        (
            {"tip": TIP | {"relative_to": "base"}},
            "reference.tip.relative_to = 'base': unknown field",
        ),
        (
            {"tip": TIP | {"orientation": 1}},
            "reference.tip.orientation = 1: must be a list of signals",
        ),
        ({"tip": TIP | {"rate": 0}}, "reference.tip.rate = 0: must be at least 0.001"),
        (
            {"tip": TIP | {"rate": 1e6, "base_share": 0.5}},
            "reference.tip.rate = 1000000.0: makes 4000001 samples",
        ),
        ({"tip": TIP | {"speed": 1}}, "reference.tip.speed = 1: unknown field"),
        (
            {"base": WAYPOINTS | {"points": 1}},
            "reference.base.points = 1: must be a list of points [x, y, z]",
        ),
        (
            {"base": WAYPOINTS | {"points": [[0, 0, 1]]}},
            "reference.base.points = 1 points: must be 2 to 300",
        ),
        (
            {"base": WAYPOINTS | {"points": [[0, 0, 1], [0, 1]]}},
            "reference.base.points[1] = [0, 1]: must be three",
        ),
        (
            {"base": WAYPOINTS | {"points": [[0, 0, 1]] * 2}},
            "reference.base.points[1] = [0.0, 0.0, 1.0]: must be 0.001",
        ),
        (
            {"base": WAYPOINTS | {"times": [1, 0]}},
            "reference.base.times = [1.0, 0.0]: must be at least two times",
        ),
        (
            {"base": WAYPOINTS | {"times": [0, 1, 2]}},
            "reference.base.times = 3 times: must be one for each of 2 points",
        ),
        (
            {"base": WAYPOINTS | {"tilt": 2}},
            "reference.base.tilt = 2.0: must be below pi/2 rad",
        ),
        (
            {"base": WAYPOINTS | {"speed": 0}},
            "reference.base.speed = 0: must be above 0",
        ),
        (
            {"base": WAYPOINTS | {"thrust": 2.4}},
            "reference.base.thrust = 2.4: must be above 1 and at most 2.25, 0.9 of",
        ),
        ({"base": PHASES}, "reference.base.phases: is missing"),
        (
            {"base": PHASES | {"phases": []}},
            "reference.base.phases = []: must be a list of phases",
        ),
        (
            {"base": PHASES | {"phases": [{"kind": "zzz"}]}},
            "reference.base.phases[0].kind = 'zzz': must be one of",
        ),
        (
            {"base": PHASES | {"phases": [{"kind": "hold"}]}},
            "reference.base.phases[0].duration: is missing",
        ),
        (
            {
                "base": (
                    PHASES
                    | {
                        "phases": [
                            {"kind": "pick", "payload": 1, "position": [0, 0, 0]}
                        ]
                    }
                )
            },
            "reference.base.phases[0].payload = 1: must be the name of a payload",
        ),
        (
            {"yaw": {"kind": "spline", "times": [0, 1], "values": [0]}},
            "reference.yaw.values = 1 values: must be one",
        ),
        (
            {"yaw": SAMPLES | {"file": 3}},
            "reference.yaw.file = 3: must be the path of a CSV file",
        ),
        ({"yaw": SAMPLES | {"file": "no.csv"}}, "reference.yaw.file = 'no.csv': "),
    ],
)
def test_a_wrong_table_gets_one_line(table, message):
    with pytest.raises(ValueError) as caught:  # noqa: PT011
        reference_from(table, 2, "reference", TWO)
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)


def test_a_vehicle_without_a_tip_that_moves_is_refused():
    for vehicle in (
        skyarm.load_vehicle("hummingbird"),
        dataclasses.replace(ARM2, end_effector=""),
    ):
        with pytest.raises(
            ValueError, match=r"^reference\.tip: needs a (vehicle with a )?tip"
        ):
            reference_from(
                {"tip": {"path": CIRCLE}},
                vehicle.n,
                "reference",
                Setting(vehicle=vehicle, duration=1.0),
            )
