"""Trajectories from tables."""

import math
import tomllib

import pytest

from skyarm.reference import (
    Constant,
    Ramp,
    Shifted,
    Sine,
    Trajectory,
    Windowed,
    circle,
    hover,
    sequence,
    signal_from,
    trajectory_from,
)
from skyarm.reference import reference_tables as module

CASE1 = """
yaw = 0.1
base = { kind = "hover", position = [0, 0, 1] }
[[joints]]
kind = "sequence"
start = 6
segments = [[1, 0.3], [5, 0.3], [1, 0], [1, -0.3], [5, -0.3], [1, 0]]
[[joints]]
kind = "constant"
value = 0.0
"""

TIMES = [
    0.0,
    5.999,
    6.0,
    6.4,
    7.0,
    12.5,
    13.0,
    13.3,
    14.0,
    19.5,
    20.0,
    20.99,
    21.0,
    30.0,
]


def same(a, b):
    assert [a.at(t) for t in TIMES] == [b.at(t) for t in TIMES]


def test_the_documented_example_loads():
    lines = module.__doc__.split("::\n")[1].split("Motions of the base")[0]
    table = tomllib.loads("\n".join(line.strip() for line in lines.splitlines()))[
        "reference"
    ]
    joint = Windowed(Shifted(Sine(amplitude=0.2, frequency_hz=0.08), 6.0), 6.0, 21.0)
    expected = circle(
        radius=0.3,
        frequency_hz=0.08,
        center=(0.0, 0.0, 1.0),
        start=6.0,
        stop=21.0,
        joints=(joint,),
    )
    same(trajectory_from(table, 1, "x"), expected)


def test_case_1_loads():
    segments = [
        (1.0, 0.3),
        (5.0, 0.3),
        (1.0, 0.0),
        (1.0, -0.3),
        (5.0, -0.3),
        (1.0, 0.0),
    ]
    expected = hover((0.0, 0.0, 1.0), yaw=0.1, joints=(sequence(6.0, segments), 0.0))
    same(trajectory_from(tomllib.loads(CASE1), 2, "x"), expected)


def test_an_empty_table_stays_at_the_origin():
    same(trajectory_from({}, 2, "x"), hover((0.0, 0.0, 0.0), joints=(0.0, 0.0)))


def test_motions_and_signals_in_a_list_add():
    base = [
        {"kind": "hover", "position": [0, 0, 1]},
        {
            "kind": "signals",
            "x": [
                0.5,
                {
                    "kind": "ramp",
                    "start": 1,
                    "duration": 2,
                    "height": 3,
                    "shape": "quintic",
                },
            ],
        },
    ]
    expected = Trajectory(
        x=Constant(0.5) + Ramp(start=1.0, duration=2.0, height=3.0, shape="quintic"),
        z=Constant(1.0),
        yaw=Sine(amplitude=0.2, frequency_hz=0.1, phase=0.3),
    )
    yaw = {"kind": "sine", "amplitude": 0.2, "frequency_hz": 0.1, "phase": 0.3}
    same(trajectory_from({"base": base, "yaw": yaw}, 0, "x"), expected)


def test_every_kind_of_signal_loads():
    sine = {"kind": "sine", "amplitude": 1, "frequency_hz": 0.5}
    cases = [
        (0.3, Constant(0.3)),
        (
            {"kind": "constant", "value": 2, "start": 1, "stop": 3},
            Windowed(Constant(2.0), 1.0, 3.0),
        ),
        (sine, Sine(amplitude=1.0, frequency_hz=0.5)),
        (
            sine | {"stop": 9},
            Windowed(Sine(amplitude=1.0, frequency_hz=0.5), -math.inf, 9.0),
        ),
        (
            {"kind": "sum", "signals": [1, sine]},
            Constant(1.0) + Sine(amplitude=1.0, frequency_hz=0.5),
        ),
        (
            {"kind": "windowed", "signal": sine, "start": 7},
            Windowed(Sine(amplitude=1.0, frequency_hz=0.5), 7.0),
        ),
        (
            {"kind": "shifted", "signal": sine, "delay": 0.3},
            Shifted(Sine(amplitude=1.0, frequency_hz=0.5), 0.3),
        ),
        (
            {"kind": "sequence", "start": 6, "initial": 1, "segments": [[2, 0]]},
            sequence(6.0, [(2.0, 0.0)], initial=1.0),
        ),
    ]
    for entry, expected in cases:
        signal = signal_from(entry, "x")
        assert [signal.derivatives(t) for t in TIMES] == [
            expected.derivatives(t) for t in TIMES
        ]
        assert signal.switch_times() == expected.switch_times()


CIRCLE = {"kind": "circle", "radius": 0.3, "frequency_hz": 0.08, "center": [0, 0, 1]}
SINE = {"kind": "sine", "amplitude": 0.3, "frequency_hz": 0.5}
RAMP = {"kind": "ramp", "start": 0, "duration": 1, "height": 1}
SEQUENCE = {"kind": "sequence", "start": 6, "segments": [[1, 0.3]]}


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (
            {"bass": {}},
            (
                "f.toml: reference.bass = {}: unknown field; did you mean 'base'?"
                " allowed: base, yaw, joints"
            ),
        ),
        ({"base": 3}, "f.toml: reference.base = 3: must be a table"),
        (
            {"base": {"position": [0, 0, 1]}},
            "f.toml: reference.base.kind: is missing; there are position",
        ),
        (
            {"base": {"kind": "spiral"}},
            (
                "f.toml: reference.base.kind = 'spiral': did you mean 'signals'? must"
                " be one of hover, circle, signals"
            ),
        ),
        (
            {"base": {"kind": ["hover"]}},
            "f.toml: reference.base.kind = ['hover']: must be one of hover",
        ),
        ({"base": {"kind": "hover"}}, "f.toml: reference.base.position: is missing"),
        (
            {"base": {"kind": "hover", "position": [0, 0]}},
            "f.toml: reference.base.position = [0, 0]: must be three",
        ),
        (
            {"base": [{"kind": "hover", "position": [0, 0, math.nan]}]},
            "f.toml: reference.base[0].position[2] = nan: must be a finite number",
        ),
        (
            {"base": CIRCLE | {"radius": -1}},
            "f.toml: reference.base.radius = -1: must be at least 0",
        ),
        (
            {"base": CIRCLE | {"radius": "0.3"}},
            "f.toml: reference.base.radius = '0.3': must be a finite number",
        ),
        (
            {"base": CIRCLE | {"frequency": 1}},
            (
                "f.toml: reference.base.frequency = 1: unknown field; did you mean"
                " 'frequency_hz'? allowed: kind, r"
            ),
        ),
        (
            {"base": CIRCLE | {"start": 9, "stop": 6}},
            "f.toml: reference.base.stop = 6.0: must be after start = 9.0",
        ),
        (
            {"base": {"kind": "signals", "x": RAMP | {"kind": "hop"}}},
            "f.toml: reference.base.x.kind = 'hop': must be one",
        ),
        ({"yaw": math.inf}, "f.toml: reference.yaw = inf: must be a finite number"),
        ({"yaw": True}, "f.toml: reference.yaw = True: must be a finite number"),
        (
            {"joints": [0.0]},
            (
                "f.toml: reference.joints = 1 signals: must be a list of 2, one for"
                " each joint"
            ),
        ),
        ({"joints": SINE}, "f.toml: reference.joints = {'kind': 'sine'"),
        (
            {"joints": [0, SINE | {"amplitude": math.nan}]},
            "f.toml: reference.joints[1].amplitude = nan: must be a fin",
        ),
        (
            {"joints": [0, SINE | {"start": math.nan}]},
            "f.toml: reference.joints[1].start = nan: must be a number",
        ),
        (
            {"joints": [0, RAMP | {"duration": 0}]},
            "f.toml: reference.joints[1].duration = 0: must be above 0",
        ),
        (
            {"joints": [0, RAMP | {"shape": "s"}]},
            "f.toml: reference.joints[1].shape = 's': must be one of linear, quin",
        ),
        (
            {"joints": [[0, RAMP | {"height": None}], 0]},
            "f.toml: reference.joints[0][1].height = None: must be a finite",
        ),
        (
            {"joints": [0, SEQUENCE | {"segments": []}]},
            "f.toml: reference.joints[1].segments = []: must be a list of",
        ),
        (
            {"joints": [0, SEQUENCE | {"segments": [[1]]}]},
            "f.toml: reference.joints[1].segments[0] = [1]: must be [dur",
        ),
        (
            {"joints": [0, SEQUENCE | {"segments": [[0, 1]]}]},
            "f.toml: reference.joints[1].segments[0][0] = 0: must be a",
        ),
        (
            {"joints": [0, {"kind": "sum", "signals": 1}]},
            "f.toml: reference.joints[1].signals = 1: must be a list",
        ),
        (
            {"joints": [0, {"kind": "shifted", "signal": SINE}]},
            "f.toml: reference.joints[1].delay: is missing",
        ),
    ],
)
def test_a_wrong_table_gets_one_line_with_field_value_and_what_is_allowed(
    table, message
):
    with pytest.raises(ValueError) as caught:  # noqa: PT011
        trajectory_from(table, 2, "f.toml: reference")
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)
