"""Components whose functions cannot be called as the loop calls them: one line with
file, line, class and method.
"""

from __future__ import annotations

import dataclasses
import inspect
import textwrap
from dataclasses import dataclass
from typing import Any

import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.log.formats import load_log
from skyarm.log.metrics.accumulate import added_metric
from skyarm.records.files import Fields
from skyarm.records.read_table import record_from
from skyarm.records.registry import RegistryError, register
from skyarm.records.registry.contract import class_mistake
from skyarm.records.registry.plugins import load_plugin
from skyarm.reference import Signal, signal_from
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import JointDrive, NamedSensor
from skyarm.simulate.examine import require_shapes
from support.components import registry_kept

BASE = load_scenario("case1", duration=0.25)

BASE_TABLES = {
    "name": "own",
    "duration": 0.1,
    "plant": {"vehicle": "hummingbird_arm2_rotors"},
    "model": {"vehicle": "hummingbird_arm2"},
    "controller": {"preset": "paper_ct"},
    "reference": {"base": {"kind": "hover", "position": [0.0, 0.0, 1.0]}},
}


def made(base: type, **members: Any) -> Any:
    """A component of a class with these members, as a dataclass."""
    return dataclass(frozen=True, kw_only=True)(
        type("Own", (base,), {"__module__": __name__, **members})
    )()


def flown(base: type, **members: Any) -> Any:
    """A scenario with such a component."""
    record = made(base, **members)
    fields = {
        skyarm.Air: lambda: {"air": (record,)},
        skyarm.Force: lambda: {"forces": (record,)},
        skyarm.Drive: lambda: {"drives": (JointDrive(joint="joint2", drive=record),)},
        skyarm.Sensor: lambda: {"sensors": (NamedSensor(name="gps", sensor=record),)},
        skyarm.Estimator: lambda: {"estimator": record},
        skyarm.Ending: lambda: {"endings": (record,)},
    }
    return dataclasses.replace(BASE, **fields[base]())


def measure(self, memory, t, state, specific_force, draws, dt):
    return memory, tuple(state.position)


WRONG: dict[str, tuple[type, dict[str, Any], str]] = {
    "velocity": (
        skyarm.Air,
        {"velocity": lambda self, memory, t: 0},
        (
            "cannot be called as velocity(memory, t, "
            "position_W): is velocity(self, memory, t), too many positional arguments"
        ),
    ),
    "advance": (
        skyarm.Air,
        {"advance": lambda self, memory, t, dt: memory},
        "cannot be called as advance(memory, t, dt, state, draws)",
    ),
    "wrenches": (
        skyarm.Force,
        {"wrenches": lambda self, motion: []},
        "cannot be called as wrenches(memory, t, motion, rotor_speeds)",
    ),
    "order": (
        skyarm.Force,
        {"wrenches": lambda self, memory, motion, t, rotor_speeds: []},
        (
            "takes 'motion' in wrenches where 't' is given: is called as"
            " wrenches(memory, t, motion, rotor_speeds)"
        ),
    ),
    "effort": (
        skyarm.Drive,
        {"effort": lambda self, memory, setpoint, r: r},
        "cannot be called as effort(memory, setpoint, position, rate)",
    ),
    "start": (
        skyarm.Drive,
        {"start": (), "effort": lambda self, m, setpoint, position, rate: rate},
        "has start = (): must be a function, called as start(position)",
    ),
    "property": (
        skyarm.Sensor,
        {"start": property(lambda self: ()), "measure": measure},
        "has start = a property: must be a function, called as start(vehicle)",
    ),
    "static": (
        skyarm.Sensor,
        {"start": staticmethod(lambda: ()), "measure": measure},
        "cannot be called as start(vehicle): is start(), too many positional arguments",
    ),
    "measure": (
        skyarm.Sensor,
        {"measure": lambda self, memory, t, state, draws: 0},
        "cannot be called as measure(memory, t, state, specific_force, draws, dt)",
    ),
    "estimator": (
        skyarm.Estimator,
        {"step": lambda self, memory, readings: 0},
        "cannot be called as step(memory, readings, command, dt)",
    ),
    "required": (
        skyarm.Ending,
        {
            "status": "own",
            "fine": lambda self, scenario, state, goal, slack, more: True,
        },
        "cannot be called as fine(scenario, state, goal, slack)",
    ),
    "uniforms of a sensor": (
        skyarm.Sensor,
        {"uniforms": 3, "measure": measure},
        "has uniforms = 3: must be a function, called as uniforms(vehicle)",
    ),
    "uniforms of an air": (
        skyarm.Air,
        {"uniforms": lambda self, vehicle: 3},
        "has a function uniforms: must be a field, a class attribute or a property",
    ),
    "half a draw": (
        skyarm.Sensor,
        {"uniforms": lambda self, vehicle: 3.5, "measure": measure},
        "gives uniforms = 3.5: must be a whole number from 0 to 10000",
    ),
    "fewer than none": (
        skyarm.Sensor,
        {"uniforms": lambda self, vehicle: -1, "measure": measure},
        "gives uniforms = -1: must be a whole number from 0 to 10000",
    ),
    "far too many": (
        skyarm.Air,
        {
            "uniforms": 10_000_000,
            "velocity": lambda self, memory, t, place: Vec3(0, 0, 0),
        },
        "has uniforms = 10000000: must be a whole number from 0 to 10000",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_function_that_the_loop_cannot_call_is_one_line(name):
    base, members, words = WRONG[name]
    with pytest.raises(ValueError, match="Own") as caught:
        skyarm.run(flown(base, **members))
    line = str(caught.value)
    assert line.startswith(f"{__file__}:"), line
    assert f" (Own) {words}" in line
    assert "\n" not in line


READINGS: dict[str, tuple[Any, str]] = {
    "list": ([1.0, 2.0], "gives a reading as a list: must be a number"),
    "dict": ({"x": 1.0}, "gives a reading as a dict: must be a number"),
    "text": ("x", "gives a reading as 'x': must be a number"),
    "none": ((1.0, None), "gives a reading[1] as None: must be a number"),
}


@pytest.mark.parametrize("name", READINGS)
def test_a_reading_that_is_no_numbers_is_one_line(name):
    value, words = READINGS[name]

    def reads(self, memory, t, state, specific_force, draws, dt):
        return memory, value

    with pytest.raises(ValueError, match="gps") as caught:
        require_shapes(flown(skyarm.Sensor, measure=reads))
    assert str(caught.value).startswith(
        f"{__file__}:{reads.__code__.co_firstlineno}: sensors.gps (Own.measure) {words}"
    )


@pytest.mark.parametrize("name", ["joints", "joint_rates"])
@pytest.mark.parametrize(
    ("given", "found"), [((), "a tuple of 0"), ((0.0,) * 3, "a tuple of 3")]
)
def test_a_measurement_of_other_joints_is_one_line(name, given, found):
    def step(self, memory, readings, command, dt):
        return memory, dataclasses.replace(readings["state"], **{name: given})

    with pytest.raises(ValueError, match="estimator") as caught:
        require_shapes(flown(skyarm.Estimator, step=step))
    words = f"estimator (Own) gives {name} as {found}: must be a tuple of 2"
    assert str(caught.value) == f"{__file__}:{step.__code__.co_firstlineno}: {words}"


def test_what_takes_more_ways_to_be_called_is_right():
    assert (
        class_mistake(
            type(
                made(skyarm.Air, velocity=lambda self, *everything: Vec3(0.0, 0.0, 0.0))
            )
        )
        is None
    )
    assert (
        class_mistake(
            type(
                made(
                    skyarm.Air, velocity=lambda _, m, now, place, more=1: 0, uniforms=2
                )
            )
        )
        is None
    )
    assert (
        class_mistake(
            type(
                made(
                    skyarm.Sensor,
                    start=classmethod(lambda kind, vehicle: ()),
                    measure=measure,
                )
            )
        )
        is None
    )
    assert class_mistake(type("Other", (), {"velocity": 3})) is None


@pytest.mark.parametrize(
    "base",
    [
        *(
            skyarm.Air,
            skyarm.Force,
            skyarm.Drive,
            skyarm.Sensor,
            skyarm.Estimator,
            skyarm.Ending,
            skyarm.Metric,
        ),
        *(skyarm.Fault, skyarm.TimedPayload, skyarm.Contact, Signal),
    ],
)
def test_every_function_of_every_base_is_looked_at(base):
    members = {
        name: given
        for kind in reversed(base.__mro__[:-1])
        for name, given in vars(kind).items()
    }
    public = {
        name: given for name, given in members.items() if not name.startswith("_")
    }
    functions = {
        name: given for name, given in public.items() if inspect.isfunction(given)
    }
    assert functions
    for name, given in functions.items():
        assert given.__doc__, f"help(skyarm.{base.__name__}) says nothing about {name}"
        kind = dataclass(frozen=True, kw_only=True)(
            type("Own", (base,), {"__module__": __name__, name: lambda: 0})
        )
        mistake = class_mistake(kind)
        assert mistake is not None
        assert mistake.what.startswith(f"cannot be called as {name}("), (name, mistake)


def test_a_metric_with_another_start_is_one_line():
    with registry_kept():
        register.metric("wrong_start")(
            type(made(skyarm.Metric, start=lambda self, x: (0.0,)))
        )
        with pytest.raises(
            RegistryError, match=r"metric 'wrong_start': cannot be called as start\(\)"
        ) as caught:
            added_metric("wrong_start")
        assert str(caught.value).startswith(f"{__file__}:")


PLUGINS = {
    "air": (
        (
            '@skyarm.register.air("mine")\n@dataclass(frozen=True)\nclass'
            " Mine(skyarm.Air):\n    def velocity(self, memory, t): return 0"
        ),
        ":6: air 'mine': cannot be called as velocity(",
    ),
    "ending": (
        (
            '@skyarm.register.ending("mine")\n@dataclass(frozen=True)\nclass'
            " Mine(skyarm.Ending):\n    status = 'own'\n    def fine(self, t, state):"
            " return 1"
        ),
        ":7: ending 'mine': cannot be called as fine(",
    ),
    "metric": (
        (
            '@skyarm.register.metric("mine")\n@dataclass(frozen=True)\nclass'
            " Mine(skyarm.Metric):\n    def start(self, x): return 0"
        ),
        ":6: metric 'mine': cannot be called as start()",
    ),
    "metric with a number to give": (
        (
            '@skyarm.register.metric("mine")\n@dataclass(frozen=True)\nclass'
            " Mine(skyarm.Metric):\n    limit: float\n    def start(self): return 0"
        ),
        ":7: metric 'mine': has a field 'limit' without a default",
    ),
    "fault": (
        (
            '@skyarm.register.fault("mine")\n@dataclass(frozen=True,'
            " kw_only=True)\nclass Mine(skyarm.Fault):\n    def share(self): return 1.0"
        ),
        ":6: fault 'mine': cannot be called as share(t)",
    ),
    "payload": (
        (
            '@skyarm.register.payload("mine")\n@dataclass(frozen=True,'
            " kw_only=True)\nclass Mine(skyarm.TimedPayload):\n    def"
            " events_reached(self, t): return True, False"
        ),
        ":6: payload 'mine': cannot be called as events_reached(t, position_W)",
    ),
    "world": (
        (
            '@skyarm.register.world("mine")\n@dataclass(frozen=True,'
            " kw_only=True)\nclass Mine(skyarm.Contact):\n    def slope(self, memory):"
            " return memory"
        ),
        ":6: world 'mine': cannot be called as slope(",
    ),
    "signal": (
        (
            '@skyarm.register.signal("mine")\n@dataclass(frozen=True)\nclass'
            " Mine(skyarm.reference.Signal):\n    def derivatives(self): return 1.0"
        ),
        ":6: signal 'mine': cannot be called as derivatives(t)",
    ),
    "signal of no table": (
        '@skyarm.register.signal("mine")\ndef mine(): return 1.0',
        ":3: signal 'mine': cannot be called as mine(fields)",
    ),
    "payload that is a fault": (
        (
            '@skyarm.register.payload("mine")\n@dataclass(frozen=True, kw_only=True)\n'
            "class Mine(skyarm.Fault):\n    def share(self, t): return 1.0"
        ),
        ":6: payload 'mine': is Mine: must be a subclass of skyarm.TimedPayload",
    ),
    "world that is a force": (
        (
            '@skyarm.register.world("mine")\n@dataclass(frozen=True, kw_only=True)\n'
            "class Mine(skyarm.Force):\n    def start(self, period, draws): return ()"
        ),
        ":6: world 'mine': is Mine: must be a subclass of skyarm.Contact",
    ),
    "air that is a function": (
        '@skyarm.register.air("mine")\ndef mine(t): return 1.0',
        ":3: air 'mine': is mine: must be a subclass of skyarm.Air",
    ),
    "no name": (
        (
            "@skyarm.register.fault\n@dataclass(frozen=True, kw_only=True)\nclass"
            " Mine(skyarm.Fault):\n    def share(self, t): return 1.0"
        ),
        ":6: register.fault: name = <class 'skyarm_plugin_mine",
    ),
    "field kind": (
        (
            '@skyarm.register.force("mine")\n@dataclass(frozen=True,'
            " kw_only=True)\nclass Mine(skyarm.Force):\n    kind: str = ''\n    def"
            " start(self, period, draws): return ()"
        ),
        ":7: force 'mine': has a field 'kind': must have another name",
    ),
    "field mode": (
        (
            '@skyarm.register.force("mine")\n@dataclass(frozen=True,'
            " kw_only=True)\nclass Mine(skyarm.Force):\n    mode: str = ''\n    def"
            " start(self, period, draws): return ()"
        ),
        ":7: force 'mine': has a field 'mode': must have another name",
    ),
    "no dataclass": (
        (
            '@skyarm.register.air("mine")\nclass Mine(skyarm.Air):\n'
            "    def velocity(self, memory, t, place): return 0"
        ),
        ":5: air 'mine': is no dataclass: must be ",
    ),
    "format": (
        (
            "def write(log, path): return"
            ' path\n\nskyarm.register.log_format("mine")(write)'
        ),
        ":3: log_format 'mine': is write: must be skyarm.LogFormat(write, read)",
    ),
    "write": (
        (
            "def write(log): return"
            ' log\n\nskyarm.register.log_format("mine")(skyarm.LogFormat(write))'
        ),
        ":3: log_format 'mine': cannot be called as write(log, path)",
    ),
}


@pytest.mark.parametrize("name", PLUGINS)
def test_a_plugin_is_refused_where_it_registers(name, tmp_path):
    text, words = PLUGINS[name]
    path = tmp_path / "mine.py"
    path.write_text(
        f"import skyarm\nfrom dataclasses import dataclass\n{textwrap.dedent(text)}\n"
    )
    with registry_kept(), pytest.raises(RegistryError) as caught:
        load_plugin(path)
    assert str(caught.value).startswith(f"{path}{words}"), str(caught.value)


WRONG_RESULTS: dict[str, tuple[str, dict[str, Any], str]] = {
    "signal": (
        (
            "class Mine(skyarm.reference.Signal):\n    def derivatives(self, t):"
            " return 1.0"
        ),
        {
            "reference": {
                "base": {"kind": "hover", "position": [0.0, 0.0, 1.0]},
                "yaw": {"kind": "mine"},
            }
        },
        "Mine.derivatives gives 1.0: must be a tuple of five",
    ),
    "signal in a fault": (
        (
            "class Mine(skyarm.reference.Signal):\n    def derivatives(self, t): return"
            " 1.0, 0, 0, 0, ()"
        ),
        {
            "environment": {
                "faults": [{"rotor": "front", "effectiveness": {"kind": "mine"}}]
            }
        },
        (
            "environment.faults[0].signal (Mine.derivatives) gives derivatives[0],"
            " derivatives[1], "
        ),
    ),
    "fault": (
        "class Mine(skyarm.Fault):\n    def share(self, t): return (1.0,)",
        {
            "environment": {
                "faults": [{"kind": "mine", "rotor": "front", "effectiveness": 0.9}]
            }
        },
        "environment.faults[0] (Mine.share) gives a share[0]: must be a share",
    ),
}


@pytest.mark.parametrize("name", WRONG_RESULTS)
def test_a_fault_or_signal_of_another_result_is_refused_before_a_flight(name, tmp_path):
    text, tables, words = WRONG_RESULTS[name]
    path, kind = tmp_path / "mine.py", name.partition(" ")[0]
    text = (
        f'@skyarm.register.{kind}("mine")\n@dataclass(frozen=True,'
        f" kw_only=True)\n{text}"
    )
    path.write_text(f"import skyarm\nfrom dataclasses import dataclass\n{text}\n")
    with registry_kept():
        load_plugin(path)
        with pytest.raises(ValueError, match="Mine") as caught:
            skyarm.run(skyarm.scenario_from(BASE_TABLES | tables))
    assert str(caught.value).startswith(f"{path}:6: {words}"), str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_function_that_makes_no_signal_is_one_line():
    def makes(fields):
        return 1.0

    with registry_kept():
        register.signal("mine")(makes)
        with pytest.raises(
            ValueError,
            match=r": .*makes gives 1\.0: must be a skyarm\.reference\.Signal",
        ):
            signal_from({"kind": "mine"}, "yaw")


def test_an_annotation_that_cannot_be_found_is_named():
    @dataclass(frozen=True, kw_only=True)
    class Lost(skyarm.Ending):
        width: float = 1.0
        place: Nowhere = 2.0  # noqa: F821

    with pytest.raises(
        ValueError,
        match=r"^endings\[0\]\.place: the annotation of this field names a type",
    ):
        record_from(Lost, Fields({"width": 1.0}, "endings[0]"))


def test_a_format_of_this_process_is_looked_at_when_it_is_used():
    with registry_kept():
        register.log_format("mine")(measure)
        with pytest.raises(
            RegistryError,
            match=r"log_format 'mine': is measure: must be skyarm.LogFormat",
        ):
            load_log("flight.mine")
