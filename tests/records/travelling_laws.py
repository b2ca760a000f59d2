"""Laws as people write them, each with something that a copy in another process may
lose. Also run as a script.
"""

from __future__ import annotations

import dataclasses
import enum
import functools
import pickle
import sys
import threading
from collections.abc import Callable, Mapping
from typing import Any

import skyarm
from skyarm import Command
from skyarm.records.travel import pack

NOTHING = object()
LOCK = threading.Lock()
"""Neither can be sent: they are the module's own in each process."""


class Mode(enum.Enum):
    STAY = 1
    GO = 2


def nothing() -> object:
    return NOTHING


def going() -> Mode:
    return Mode.GO


def base(model: Any) -> Any:
    return skyarm.preset("paper_pd", model)


def held_by(law: Any, plain: Any) -> Any:
    return skyarm.Controller(name="mine", law=law, par=plain.par, memory=plain.memory)


def more(found: Any, by: Any) -> Any:
    """Result of a law whose rotors turn faster."""
    memory, command = found
    return memory, Command(
        rotor_speeds=tuple(s + by for s in command.rotor_speeds),
        efforts=command.efforts,
    )


def shifted(memory: Any, *given: Any, par: Any, law: Any, by: float) -> Any:
    return more(law(memory, *given, par=par), by)


def compares_a_global(model: Any) -> Any:
    plain = base(model)

    def law(*given: Any, par: Any) -> Any:
        return more(plain.law(*given, par=par), 1.0 if nothing() is NOTHING else 9.0)

    return held_by(law, plain)


def compares_members(model: Any) -> Any:
    plain = base(model)

    class Own(enum.Enum):
        A = 1

    mine = Own.A

    def law(*given: Any, par: Any) -> Any:
        return more(
            plain.law(*given, par=par),
            1.0 if going() is Mode.GO and mine is Own.A else 9.0,
        )

    return held_by(law, plain)


def is_a_lambda(model: Any) -> Any:
    plain = base(model)
    return held_by(lambda *given, par: more(plain.law(*given, par=par), 2.0), plain)


def is_a_partial(model: Any) -> Any:
    plain = base(model)
    return held_by(functools.partial(shifted, law=plain.law, by=3.0), plain)


def is_of_a_class(model: Any) -> Any:
    plain = base(model)

    class Law:
        by = 4.0

        def __init__(self, scale: float) -> None:
            self.scale = scale

        def __call__(self, *given: Any, par: Any) -> Any:
            return more(plain.law(*given, par=par), self.by * self.scale)

    class Other(Law):
        by = 5.0

        def __init__(self) -> None:
            super().__init__(1.5)

    return held_by(Other(), plain)


def is_a_method(model: Any) -> Any:
    plain = base(model)

    class Law:
        def step(self, *given: Any, par: Any) -> Any:
            return more(plain.law(*given, par=par), 6.0)

    return held_by(Law().step, plain)


def has_records_of_its_own(model: Any) -> Any:
    plain = base(model)

    @dataclasses.dataclass(frozen=True, kw_only=True)
    class Par:
        model: skyarm.Model
        inner: Any
        by: float = 7.0

    @dataclasses.dataclass(frozen=True, kw_only=True)
    class Sum:
        inner: Any
        total: float = 0.0

    def law(memory: Any, seen: Any, wanted: Any, dt: Any, *, par: Any) -> Any:
        inner, command = more(
            plain.law(memory.inner, seen, wanted, dt, par=par.inner),
            par.by + memory.total,
        )
        return (
            dataclasses.replace(memory, inner=inner, total=memory.total + dt),
            command,
        )

    par = Par(model=model, inner=plain.par)
    return skyarm.Controller(
        name="mine", law=law, par=par, memory=Sum(inner=plain.memory)
    )


def is_decorated(model: Any) -> Any:
    plain = base(model)

    def faster(law: Any) -> Any:
        @functools.wraps(law)
        def both(*given: Any, **named: Any) -> Any:
            return more(law(*given, **named), 1.0)

        return both

    return held_by(faster(faster(plain.law)), plain)


def calls_itself(model: Any) -> Any:
    plain = base(model)

    def law(*given: Any, par: Any, times: int = 3) -> Any:
        return (
            more(law(*given, par=par, times=times - 1), 1.0)
            if times
            else plain.law(*given, par=par)
        )

    return held_by(law, plain)


def locks(model: Any) -> Any:
    plain = base(model)

    def law(*given: Any, par: Any) -> Any:
        with LOCK:
            return more(plain.law(*given, par=par), 8.0)

    return held_by(law, plain)


OF_SCRIPTS: tuple[Callable[[Any], Any], ...] = (
    compares_a_global,
    is_a_lambda,
    is_of_a_class,
    has_records_of_its_own,
)
"""What a script holds goes by content."""

OF_MODULES: tuple[Callable[[Any], Any], ...] = (
    locks,
    compares_a_global,
    compares_members,
    is_a_lambda,
    is_a_partial,
    is_of_a_class,
    is_a_method,
    has_records_of_its_own,
    is_decorated,
    calls_itself,
)


def planned(make: Callable[[Any], Any]) -> Any:
    plain = skyarm.load_scenario("case1", duration=0.1)
    return dataclasses.replace(plain, controller=make(plain.controller.par.model))


def packed_flights(
    makers: Mapping[str, Callable[[Any], Any]],
) -> dict[str, tuple[dict[str, bytes], bytes]]:
    """Arrays of a flight here, and its scenario for another process, by name."""
    scenarios = {name: planned(make) for name, make in makers.items()}
    return {name: (arrays_of(each), pack(each)) for name, each in scenarios.items()}


def arrays_of(scenario: Any) -> dict[str, bytes]:
    return {
        name: array.tobytes() for name, array in skyarm.run(scenario).arrays().items()
    }


if __name__ == "__main__":
    sys.stdout.buffer.write(
        pickle.dumps(packed_flights({make.__name__: make for make in OF_SCRIPTS}))
    )
