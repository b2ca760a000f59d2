"""Components and laws of a user's own, right and wrong ones.

- Components of a user's own, as examples: what no file of the library knows. Each is
  written as a plugin would be.
- Laws of one's own that are wrong, as people write them: each a file, the line that is
  blamed, and the words.
"""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from skyarm.algebra import ZERO3, Vec3
from skyarm.algebra.scalars import exp, sqrt
from skyarm.algebra.scalars.philox import normals
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.actuators.drive import Drive
from skyarm.records.registry import names, plugins
from skyarm.records.registry.registrations import _FOUND, _SOURCE
from skyarm.scenario.endings import Ending
from skyarm.sensing.estimate.estimator import FULL_STATE, Estimator
from skyarm.sensing.sensor import Sensor
from skyarm.world import Air, Force, Wrench


@dataclass(frozen=True, kw_only=True)
class Turbulence(Air):
    """Turbulence of first order: its memory is the three components in standard
    deviations.
    """

    sigma: float = 0.5
    time: float = 0.5
    uniforms = 4

    def __post_init__(self) -> None:
        if isinstance(self.time, float) and not self.time > 0.0:
            raise ValueError(f"time = {self.time!r}: must be above 0 s")

    def start(self, period: float, draws: Sequence[Any]) -> Any:
        return tuple(normals(draws)[:3])

    def advance(
        self, memory: Any, t: Any, dt: float, state: Any, draws: Sequence[Any]
    ) -> Any:
        a = exp(-dt / self.time)
        return tuple(
            a * m + sqrt(1.0 - a * a) * x
            for m, x in zip(memory, normals(draws)[:3], strict=True)
        )

    def velocity(self, memory: Any, t: Any, position_W: Vec3) -> Vec3:
        return Vec3(*memory) * self.sigma


@dataclass(frozen=True, kw_only=True)
class Shear(Air):
    """Wind along x that grows with height: it depends on the place."""

    rate: float = 0.3

    def velocity(self, memory: Any, t: Any, position_W: Vec3) -> Vec3:
        return Vec3(self.rate * position_W.z, 0, 0)


@dataclass(frozen=True, kw_only=True)
class RandomPush(Force):
    """A vertical force on the base, drawn anew each period."""

    sigma: float = 0.0
    uniforms = 2

    def start(self, period: float, draws: Sequence[Any]) -> Any:
        return (0.0,)

    def advance(
        self, memory: Any, t: Any, dt: float, state: Any, draws: Sequence[Any]
    ) -> Any:
        return (normals(draws)[0],)

    def wrenches(
        self, memory: Any, t: Any, motion: Any, rotor_speeds: Sequence[Any]
    ) -> Sequence[Wrench]:
        return (Wrench(force_W=Vec3(0.0, 0.0, self.sigma * memory[0])),)


@dataclass(frozen=True, kw_only=True)
class Tether(Force):
    """A spring and damper from a point of a body to a place of the world: it depends on
    the state.
    """

    anchor: Vec3 = ZERO3
    stiffness: float = 2.0
    damping: float = 0.1
    point: Vec3 = ZERO3
    body: int = -1

    def wrenches(
        self, memory: Any, t: Any, motion: Any, rotor_speeds: Sequence[Any]
    ) -> Sequence[Wrench]:
        apart = self.anchor - motion.position(self.point, self.body)
        force = (
            apart * self.stiffness
            - motion.velocity(self.point, self.body) * self.damping
        )
        return (Wrench(force_W=force, point=self.point, body=self.body),)


@dataclass(frozen=True, kw_only=True)
class SteadyWrench(Force):
    """The same force and torque on one body for ever."""

    force: Vec3 = ZERO3
    torque: Vec3 = ZERO3
    point: Vec3 = ZERO3
    body: int = -1

    def wrenches(
        self, memory: Any, t: Any, motion: Any, rotor_speeds: Sequence[Any]
    ) -> Sequence[Wrench]:
        return (
            Wrench(
                force_W=self.force,
                torque_W=self.torque,
                point=self.point,
                body=self.body,
            ),
        )


@dataclass(frozen=True, kw_only=True)
class Fix(Sensor):
    """Position with white noise; its memory counts the readings, and a reading says
    which one it is and when it was.
    """

    rate: float = 0.0
    delay: float = 0.0
    sigma: float = 0.0

    @property
    def frequency(self) -> float:
        return self.rate

    @property
    def latency(self) -> float:
        return self.delay

    def uniforms(self, vehicle: Any) -> int:
        return 4

    def start(self, vehicle: Any) -> Any:
        return (0.0,)

    def measure(
        self,
        memory: Any,
        t: Any,
        state: Any,
        specific_force: Vec3,
        draws: Sequence[Any],
        dt: float,
    ) -> Any:
        noise = normals(draws)[:3]
        where_to = tuple(
            p + self.sigma * x for p, x in zip(state.position, noise, strict=True)
        )
        return (memory[0] + 1.0,), (1.0 * t, memory[0], *where_to, 1.0 * dt)


@dataclass(frozen=True, kw_only=True)
class Blend(Estimator):
    """The full state, its position drawn towards a fix; its memory is the offset."""

    gain: float = 0.02
    sensor: str = "fix"

    def start(self, vehicle: Any) -> Any:
        return (0.0, 0.0, 0.0)

    def step(
        self, memory: Any, readings: Mapping[str, Any], command: Command, dt: float
    ) -> Any:
        full, fix = readings[FULL_STATE], readings[self.sensor][2:5]
        off = tuple(
            m + self.gain * (p - q - m)
            for m, p, q in zip(memory, fix, full.position, strict=True)
        )
        return off, dataclasses.replace(full, position=full.position + Vec3(*off))


@dataclass(frozen=True, kw_only=True)
class Lag(Drive):
    """The torque follows its setpoint with a lag of first order."""

    lag: float = 0.02

    def start(self, position: Any) -> Any:
        return (0.0,)

    def advance(
        self, memory: Any, setpoint: Any, position: Any, rate: Any, dt: float
    ) -> Any:
        return (memory[0] + (setpoint - memory[0]) * (1.0 - exp(-dt / self.lag)),)

    def effort(self, memory: Any, setpoint: Any, position: Any, rate: Any) -> Any:
        return memory[0]

    def standing(self, effort: Any, position: Any) -> Any:
        return effort


@dataclass(frozen=True, kw_only=True)
class Servo(Drive):
    """A position servo: its setpoint is an angle."""

    stiffness: float = 0.3
    damping: float = 0.003

    def effort(self, memory: Any, setpoint: Any, position: Any, rate: Any) -> Any:
        return self.stiffness * (setpoint - position) - self.damping * rate

    def standing(self, effort: Any, position: Any) -> Any:
        return position + effort / self.stiffness


@dataclass(frozen=True, kw_only=True)
class Ceiling(Ending):
    """Too high."""

    height: float = 3.0
    status = "ceiling"

    def fine(self, scenario: Any, state: Any, goal: Vec3, slack: Any) -> Any:
        return state.position.z <= self.height - slack

    def cause(self, scenario: Any, state: Any, goal: Vec3) -> str:
        return f"z = {float(state.position.z):.3f} m passed {float(self.height):g}"


def telling(heard: Callable[[Any], Sequence[Any]]) -> Any:
    """A law whose rotor commands tell four numbers of what it hears, on top of 450
    rad/s; the arm is left alone.
    """

    def law(
        memory: Any, measurement: Any, reference: Any, dt: Any, *, par: Any
    ) -> tuple[Any, Command]:
        del reference, dt
        speeds = tuple(450.0 + each for each in heard(measurement))
        return memory, Command(
            rotor_speeds=speeds, efforts=(0.0,) * par.model.vehicle.n
        )

    return law


def with_law(scenario: Any, law: Any, **fields: Any) -> Any:
    """The scenario with another law, which is traced."""
    return dataclasses.replace(
        scenario, controller=dataclasses.replace(scenario.controller, law=law, **fields)
    )


def same_logs(a: Any, b: Any) -> bool:
    """Two logs to the bit."""
    ours, theirs = a.arrays(), b.arrays()
    return ours.keys() == theirs.keys() and all(
        ours[name].tobytes() == theirs[name].tobytes() for name in ours
    )


def equal_logs(a: Any, b: Any) -> bool:
    """Two logs value by value: to the bit, but that a zero may have another sign."""
    ours, theirs = a.arrays(), b.arrays()
    return ours.keys() == theirs.keys() and all(
        np.array_equal(ours[name], theirs[name]) for name in ours
    )


@contextmanager
def registry_kept() -> Iterator[None]:
    """What is registered or loaded inside is gone afterwards."""
    names("law")  # everything that ships, and what is installed, is there from now on
    found = {kind: dict(rows) for kind, rows in _FOUND.items()}
    loaded, modules, sources = (
        dict(plugins._LOADED),
        dict(plugins._MODULES),
        copy.copy(_SOURCE),
    )
    try:
        yield
    finally:
        _FOUND.update(found)
        for now, before in ((plugins._LOADED, loaded), (plugins._MODULES, modules)):
            now.clear()
            now.update(before)  # type: ignore[arg-type]
        _SOURCE[:] = sources


HEAD = '''"""A law of one's own."""
import math
import random
from dataclasses import dataclass

import numpy as np

import skyarm
from skyarm import Command
from skyarm.algebra.scalars import where


@dataclass(frozen=True, kw_only=True)
class Par:
    model: skyarm.Model
    gain: float = 10.0


@dataclass(frozen=True, kw_only=True)
class Sum:
    total: float = 0.0


HOVER, STILL = (485.0,) * 4, (0.0, 0.0)
'''

MAKE = '''

def make(model: skyarm.Model) -> skyarm.Controller:
    """The law, ready to fly."""
    par = Par(model=model)
    return skyarm.Controller(name="mine", law=law, par=par, memory={memory})
'''

LAW = "def law(memory, seen, wanted, dt, *, par):  # here"


@dataclass(frozen=True)
class Mistake:
    """One mistake.

    Attributes:
        body: the law; its line marked ``# here`` is blamed. words: after the law's
            name.
        memory: its first memory, as text. make: of the file, if another one.
    """

    body: str
    words: str
    memory: str = "()"
    make: str = MAKE

    @property
    def text(self) -> str:
        """The file."""
        return (
            HEAD
            + "\n\n"
            + self.body.strip("\n")
            + "\n"
            + self.make.format(memory=self.memory)
        )

    @property
    def line(self) -> int:
        """The line that is blamed."""
        (found,) = [
            k
            for k, line in enumerate(self.text.splitlines(), 1)
            if line.endswith("# here")
        ]
        return found


def returning(value: str, *, mark: bool = False) -> str:
    """A law of one line, which is blamed itself where it is marked."""
    return (
        f"{LAW[: -len('  # here')]}\n    return {value}  # here\n"
        if mark
        else f"{LAW}\n    return {value}\n"
    )


STATE = (
    "it keeps state outside its memory: a closure, a global, an attribute, random"
    " numbers or a clock"
)

RESULTS = {
    "one_effort": Mistake(
        returning("memory, Command(rotor_speeds=HOVER, efforts=(0.0,))"),
        "gives 1 efforts: must be 2, one for each joint",
    ),
    "no_efforts": Mistake(
        returning("memory, Command(rotor_speeds=HOVER)"),
        "gives 0 efforts: must be 2, one for each joint",
    ),
    "six_rotors": Mistake(
        returning("memory, Command(rotor_speeds=(485.0,) * 6, efforts=STILL)"),
        "gives 6 rotor_speeds: must be 4, one for each rotor",
    ),
    "an_angle_of_no_rotor": Mistake(
        returning("memory, Command(rotor_speeds=HOVER, efforts=STILL, tilts=(0.1,))"),
        "gives 1 tilts: must be 0, one for each rotor that tilts",
    ),
    "array_of_three_efforts": Mistake(
        returning("memory, Command(rotor_speeds=HOVER, efforts=np.zeros(3))"),
        "gives 3 efforts: must be 2, one for each joint",
    ),
    "table_of_efforts": Mistake(
        returning("memory, Command(rotor_speeds=HOVER, efforts=np.zeros((2, 1)))"),
        "gives efforts[0] as a NumPy array: must be a number",
    ),
    "word": Mistake(
        returning("memory, Command(rotor_speeds=list(HOVER), efforts='ab')", mark=True),
        "makes a record that cannot be: command.efforts = 'ab': must be a sequence",
    ),
    "none": Mistake(
        f"{LAW}\n    Command(rotor_speeds=HOVER, efforts=STILL)\n",
        "returns None: must return (memory, Command)",
    ),
    "command_alone": Mistake(
        returning("Command(rotor_speeds=HOVER, efforts=STILL)"),
        "returns a Command: must return (memory, Command)",
    ),
    "wrong_order": Mistake(
        returning("Command(rotor_speeds=HOVER, efforts=STILL), memory"),
        "returns (Command, a tuple of 0): must return (memory, Command), in this order",
    ),
    "three": Mistake(
        returning("memory, Command(rotor_speeds=HOVER, efforts=STILL), 0.0"),
        "returns a tuple of 3: must return (memory, Command)",
    ),
    "no_command": Mistake(
        returning("memory, (HOVER, STILL)"),
        "returns (memory, a tuple of 2): must return (memory, Command)",
    ),
    "an_effort_is_none": Mistake(
        returning("memory, Command(rotor_speeds=HOVER, efforts=(0.0, None))"),
        "gives efforts[1] as None: must be a number",
    ),
    "a_speed_is_a_vector": Mistake(
        returning(
            "memory, Command(rotor_speeds=(seen.position, 485.0, 485.0, 485.0),"
            " efforts=STILL)"
        ),
        "gives rotor_speeds[0] as a Vec3: must be a number",
    ),
    "nan": Mistake(
        returning(
            'memory, Command(rotor_speeds=HOVER, efforts=(0.0, float("nan") *'
            " seen.position.z))"
        ),
        "gives efforts[1] = nan in its first period: must be a finite number",
    ),
    "infinite": Mistake(
        returning(
            "memory, Command(rotor_speeds=(1.0 / (0.0 * seen.position.z),) * 4,"
            " efforts=STILL)"
        ),
        "gives rotor_speeds[0] = inf in its first period: must be a finite number",
    ),
}

FLY = "Command(rotor_speeds=HOVER, efforts=STILL)"

MEMORIES = {
    "int": Mistake(
        returning(f"(memory[0] + 1,), {FLY}"),
        "has memory[0] = 0: an int never changes in a program; must be 0.0",
        memory="(0,)",
    ),
    "int_in_a_record": Mistake(
        returning(f"memory, {FLY}"),
        "has memory.total = 3: an int never changes in a program; must be 3.0",
        memory="Sum(total=3)",
    ),
    "flag": Mistake(
        returning(f"(0.0, True), {FLY}"),
        "has memory[1] = False: an int never changes in a program; must be 1.0 or 0.0",
        memory="(0.0, False)",
    ),
    "dict": Mistake(
        returning(f"memory, {FLY}"),
        "has memory = {'total': 0.0}: must be a tuple or a frozen dataclass of numbers,"
        " or Controller(compiled=False), which calls it with floats",
        memory="{{'total': 0.0}}".replace("{{", "{").replace("}}", "}"),
    ),
    "list": Mistake(
        returning(f"memory, {FLY}"),
        "has memory = [0.0]: must be a tuple or a frozen dataclass of numbers, "
        "or Controller(compiled=False), which calls it with floats",
        memory="[0.0]",
    ),
    "array": Mistake(
        returning(f"memory, {FLY}"),
        "has memory = array([0., 0.]): must be a tuple or a frozen dataclass of"
        " numbers, or Controller(compiled=False), which calls it with floats",
        memory="np.zeros(2)",
    ),
    "missing": Mistake(
        returning(f"(seen.position.z,), {FLY}"),
        "changes the structure of its memory: memory is a tuple of 1, must stay a tuple"
        " of 0",
    ),
    "not_returned": Mistake(
        returning(f"(), {FLY}"),
        "changes the structure of its memory: memory is a tuple of 0, must stay a tuple"
        " of 1",
        memory="(0.0,)",
    ),
    "another_record": Mistake(
        returning(f"(0.0,), {FLY}"),
        "changes the structure of its memory: memory is a tuple of 1, must stay a Sum",
        memory="Sum()",
    ),
    "reset_to_an_int": Mistake(
        returning(f"Sum(total=0), {FLY}"),
        "changes the structure of its memory: memory.total is the int 0, must stay a"
        " number",
        memory="Sum()",
    ),
    "grows": Mistake(
        returning(f"(*memory, seen.position.z), {FLY}"),
        "changes the structure of its memory: memory is a tuple of 2, must stay a tuple"
        " of 1",
        memory="(0.0,)",
    ),
}

STATES = {
    "global": Mistake(
        f"""
total = 0.0


{LAW}
    global total
    total = total + (wanted.position.z - seen.position.z) * dt
    return memory, Command(rotor_speeds=(485.0 + par.gain * total,) * 4, efforts=STILL)
""",
        f"gives other numbers as a program in period 0 than with floats: {STATE}",
    ),
    "counter": Mistake(
        f"""
calls = [0]


{LAW}
    calls[0] += 1
    return memory, Command(rotor_speeds=(485.0 + calls[0],) * 4, efforts=STILL)
""",
        f"gives other numbers as a program in period 0 than with floats: {STATE}",
    ),
    "attribute": Mistake(
        """
class Law:
    before = None

    def __call__(self, memory, seen, wanted, dt, *, par):  # here
        rate = 0.0 if self.before is None else (seen.position.z - self.before) / dt
        self.before = seen.position.z
        return memory, Command(rotor_speeds=(485.0 - rate,) * 4, efforts=STILL)


law = Law()
""",
        f"gives other numbers as a program in period 0 than with floats: {STATE}",
    ),
    "random": Mistake(
        returning(
            "memory, Command(rotor_speeds=(485.0 + random.random(),) * 4,"
            " efforts=STILL)"
        ),
        f"gives other numbers as a program in period 0 than with floats: {STATE}",
    ),
    "once_in_ten": Mistake(
        f"""
calls = [0]


{LAW}
    calls[0] += 1
    speed = 500.0 if calls[0] == 10 else 485.0
    return memory, Command(rotor_speeds=(speed,) * 4, efforts=STILL)
""",
        f"gives other numbers as a program in period 9 than with floats: {STATE}",
    ),
    "every_other_trace": Mistake(
        f"""
calls = [0]


{LAW}
    calls[0] += 1
    speed = 500.0 if calls[0] == 22 else 485.0
    return memory, Command(rotor_speeds=(speed,) * 4, efforts=STILL)
""",
        f"gives another program in period 0 whenever it is traced: {STATE}",
    ),
}

TRACED = "or Controller(compiled=False), which calls it with floats"

TRACES = {
    "array_and_number": Mistake(
        returning(
            "memory, Command(rotor_speeds=np.full(4, 485.0) + seen.position.z,"
            " efforts=STILL)",
            mark=True,
        ),
        "cannot be traced: a NumPy array meets a traced number; must use + - * / and"
        " the functions of skyarm.algebra.scalars, " + TRACED,
    ),
    "branch": Mistake(
        """
def law(memory, seen, wanted, dt, *, par):
    error = wanted.position.z - seen.position.z
    if error > 0.0:  # here
        error = 1.0
    return memory, Command(rotor_speeds=(485.0 + error,) * 4, efforts=STILL)
""",
        "cannot be traced: branch on a traced value; use"
        " skyarm.algebra.scalars.where(condition, a, b), " + TRACED,
    ),
    "max": Mistake(
        """
def law(memory, seen, wanted, dt, *, par):
    error = max(wanted.position.z - seen.position.z, 0.0)  # here
    return memory, Command(rotor_speeds=(485.0 + error,) * 4, efforts=STILL)
""",
        "cannot be traced: branch on a traced value; use"
        " skyarm.algebra.scalars.where(condition, a, b), " + TRACED,
    ),
    "math": Mistake(
        """
def helper(x):
    return math.sin(x)  # here


def law(memory, seen, wanted, dt, *, par):
    speed = 485.0 + helper(seen.position.z)
    return memory, Command(rotor_speeds=(speed,) * 4, efforts=STILL)
""",
        "cannot be traced: float() of a traced value, " + TRACED,
    ),
    "numpy": Mistake(
        """
def law(memory, seen, wanted, dt, *, par):
    speed = 485.0 + np.sin(seen.position.z)  # here
    return memory, Command(rotor_speeds=(speed,) * 4, efforts=STILL)
""",
        "cannot be traced: operand a traced number does not support ufuncs"
        " (__array_ufunc__=None); must use + - * / and the functions of"
        " skyarm.algebra.scalars, " + TRACED,
    ),
    "norm": Mistake(
        """
def law(memory, seen, wanted, dt, *, par):
    far = np.linalg.norm([seen.position.x, seen.position.y])  # here
    return memory, Command(rotor_speeds=(485.0 + far,) * 4, efforts=STILL)
""",
        "must use + - * / and the functions of skyarm.algebra.scalars, " + TRACED,
    ),
    "power": Mistake(
        """
def law(memory, seen, wanted, dt, *, par):
    speed = 485.0 + seen.position.z**2  # here
    return memory, Command(rotor_speeds=(speed,) * 4, efforts=STILL)
""",
        "cannot be traced: unsupported operand type(s) for ** or pow(): a traced number"
        " and 'int'; must use + - * / and the functions of skyarm.algebra.scalars, "
        + TRACED,
    ),
    "writes_to_what_it_sees": Mistake(
        """
def law(memory, seen, wanted, dt, *, par):
    seen.velocity = wanted.velocity  # here
    return memory, Command(rotor_speeds=HOVER, efforts=STILL)
""",
        "changes a record: cannot assign to field 'velocity'; must make another, by"
        " dataclasses.replace",
    ),
    "writes_to_its_memory": Mistake(
        f"""
@dataclass
class Held:
    total: float = 0.0


{LAW}
    memory.total = memory.total + dt
    return memory, Command(rotor_speeds=HOVER, efforts=STILL)
""",
        "writes to its argument 'memory' in period 0: must return new records",
        memory="Held()",
    ),
    "writes_to_its_constants": Mistake(
        f"""
{LAW}
    object.__setattr__(par, "gain", par.gain + 1.0)
    return memory, Command(rotor_speeds=HOVER, efforts=STILL)
""",
        "writes to its argument 'par' in period 0: must return new records",
    ),
}

WITHOUT_FLIGHT = {
    "signature": Mistake(
        f"def law(memory, seen, wanted):  # here\n    return memory, {FLY}\n",
        "cannot be called as law(memory, measurement, reference, dt, *, par): too many"
        " positional arguments",
    ),
    "no_par": Mistake(
        f"def law(memory, seen, wanted, dt):  # here\n    return memory, {FLY}\n",
        "cannot be called as law(memory, measurement, reference, dt, *, par): got an"
        " unexpected keyword argument 'par'",
    ),
    "class_in_place_of_an_instance": Mistake(
        f"class law:\n    {LAW.replace('law(', '__call__(self, ')}\n        return"
        f" memory, {FLY}\n",
        "is the class law: must be a function, or an object with __call__, "
        "law(memory, measurement, reference, dt, *, par)",
    ),
    "no_model": Mistake(
        returning(f"memory, {FLY}"),
        "has constants without a Model: Sum.model must be the nominal one",
        make=MAKE.replace("Par(model=model)", "Sum()"),
    ),
    "constants_in_a_dict": Mistake(
        returning(f"memory, {FLY}"),
        "par must be a frozen dataclass with a field 'model'",
        make=MAKE.replace("Par(model=model)", "dict(model=model.gravity)"),
    ),
}

MAKERS = {
    "law_cannot_be_called": Mistake(
        "class Law:\n    def step(self, memory, seen, wanted, dt):\n        return"
        " memory, None\n\n\nlaw = Law()\n",
        ">: must be a function",
        make=MAKE.replace("memory={memory})", "memory={memory})  # here"),
    ),
    "returns_a_class": Mistake(
        "class Law:\n    def __call__(self, memory, seen, wanted, dt, *, par):\n       "
        " return memory, None\n",
        "returns the class Law: its maker must return a Controller",
        make="\n\ndef make(model):  # here\n    return Law\n",
    ),
    "returns_a_law": Mistake(
        f"def law(memory, seen, wanted, dt, *, par):\n    return memory, {FLY}\n",
        "its maker must return a Controller",
        make="\n\ndef make(model):  # here\n    return law\n",
    ),
    "returns_nothing": Mistake(
        "",
        "returns None: its maker must return a Controller",
        make="\n\ndef make(model):  # here\n    pass\n",
    ),
    "takes_no_model": Mistake(
        "",
        "cannot be called as maker(model): too many positional arguments",
        make="\n\ndef make():  # here\n    pass\n",
    ),
}

FINE = {
    "array": returning(
        "memory, Command(rotor_speeds=np.full(4, 485.0), efforts=np.zeros(2))"
    ),
    "list": returning("memory, Command(rotor_speeds=[485.0] * 4, efforts=[0.0, 0.0])"),
    "ints": returning(
        "memory, Command(rotor_speeds=(485, 485, 485, 485), efforts=(0, 0))"
    ),
    "numpy_numbers": returning(
        "memory, Command(rotor_speeds=(np.float64(485.0),) * 4,"
        " efforts=(np.float64(0.0),) * 2)"
    ),
}
"""What is as good as tuples of floats."""

FLOWN = {**RESULTS, **MEMORIES, **STATES, **TRACES}
EVERYTHING = {**FLOWN, **WITHOUT_FLIGHT}
