"""The guard around a law that cannot be traced: called with floats, with a memory of
any kind.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

import skyarm
from skyarm.control.catalogue import make_controller
from skyarm.control.controller import Controller
from skyarm.control.law_checks import LawError, checked_law
from skyarm.control.safety import safety_layer, with_safety_layer
from skyarm.control.safety.limits import USUAL, law_stiffness
from skyarm.dynamics.actuators import Command
from skyarm.reference import Constant, Trajectory
from skyarm.simulate import run
from skyarm.simulate.loop import run_in_python
from skyarm.world.payload import Payload
from support.cases import sampled

WIND = skyarm.load_scenario("case3_wind")
HOVER = Trajectory(z=Constant(3.0), joints=(Constant(0.0), Constant(0.0)))


def predictive(**fields):
    made = make_controller("nmpc", WIND.controller.par.model)
    return dataclasses.replace(made, **fields)


def flown(controller, duration, **fields):
    return run(
        dataclasses.replace(WIND, controller=controller, duration=duration, **fields)
    )


def failing(how, start):
    """The predictive law that from a time on returns what ``how`` makes of its
    command.
    """
    inner = predictive()

    def law(memory, measurement, reference, dt, *, par):
        following, command = inner.law(memory, measurement, reference, dt, par=par)
        return following, (how(command) if measurement.time >= start else command)

    return dataclasses.replace(inner, law=law)


@pytest.mark.thorough
def test_the_predictive_law_flies_under_guard_as_it_does_without():
    logs = [
        flown(controller, 1.0)
        for controller in (predictive(), with_safety_layer(predictive()))
    ]
    assert logs[1].status == "completed"
    # nothing is limited in this flight, and nothing is computed in another order
    for name in ("position", "joints", "rotor_commands", "efforts"):
        assert np.array_equal(getattr(logs[0], name), getattr(logs[1], name))
    controller = with_safety_layer(predictive())
    assert (controller.name, controller.compiled) == ("guarded_nmpc", False)
    assert (
        (controller.par.limits.stiffness, controller.par.limits.damping)
        == USUAL
        == law_stiffness(predictive())
    )
    assert (
        with_safety_layer(predictive(), {"stiffness": 9.0}).par.limits.stiffness == 9.0
    )


def nan(command):
    return Command(
        rotor_speeds=(math.nan, *command.rotor_speeds[1:]), efforts=command.efforts
    )


def leaning(command):
    """No feedback, front and back unlike: the vehicle turns over."""
    return Command(rotor_speeds=(500.0, 487.0, 474.0, 487.0), efforts=command.efforts)


def raising(error):
    def how(command):
        raise error

    return how


def unmakeable(command):
    """A record of the library's that refuses the number."""
    return Payload(mass=command.efforts[0] * math.nan)


FAILED = [
    OverflowError(),
    np.linalg.LinAlgError("singular"),
    ValueError("math domain error"),
    RuntimeError("solver"),
]


@pytest.mark.parametrize(
    "how",
    sampled([nan, unmakeable, *map(raising, FAILED)], 6),
    ids=["nan", "record", *(type(e).__name__ for e in FAILED)],
)
def test_a_predictive_law_that_fails_is_replaced_by_the_recovery(how):
    controller = failing(how, 0.5)
    if how is nan:
        assert flown(controller, 2.0).status != "completed"
    log = flown(with_safety_layer(controller, {"trusted_tilt": 0.8}), 4.0)
    healthy = flown(predictive(), 0.5)
    # until then the law itself flew
    assert np.array_equal(
        log.rotor_commands[: len(healthy.time)], healthy.rotor_commands
    )
    assert log.status == "completed"
    then = log.position[log.time >= 0.5][0]
    # hover there, but for wind and the masses that the recovery does not know
    assert np.linalg.norm(log.position[-1] - then) < 1.5
    assert np.linalg.norm(log.velocity[-1]) < 0.3
    assert np.abs(log.euler[-1, :2]).max() < 0.3


def test_a_mistake_in_a_laws_code_is_not_hidden():
    with pytest.raises(TypeError, match="a mistake"):
        flown(with_safety_layer(failing(raising(TypeError("a mistake")), 0.1)), 0.2)


def test_a_mistake_that_is_told_by_a_law_error_is_not_hidden_either():
    with pytest.raises(LawError, match="gives 3 rotor_speeds: must be 4"):
        flown(
            with_safety_layer(
                failing(
                    lambda c: Command(
                        rotor_speeds=c.rotor_speeds[1:], efforts=c.efforts
                    ),
                    0.1,
                )
            ),
            0.2,
        )


def test_a_called_law_under_guard_is_made_ready_to_be_looked_at_once(monkeypatch):
    called, calls = counted(WIND.controller)
    made = []
    monkeypatch.setattr(
        safety_layer, "checked_law", lambda each: made.append(each) or checked_law(each)
    )
    flown(with_safety_layer(called), 0.2)
    assert len(calls) == 40
    assert len(made) == 1


def counted(controller):
    """A traceable law that is called with floats, and how often it was."""
    calls = []

    def law(memory, measurement, reference, dt, *, par):
        calls.append(measurement.time)
        return controller.law(memory, measurement, reference, dt, par=par)

    return dataclasses.replace(controller, law=law, compiled=False), calls


def test_a_called_law_under_guard_flies_the_bits_of_a_traced_one():
    law = make_controller("ct_ladder", WIND.controller.par.model)
    tight = {"rotor_slew": 2e3, "effort": 0.05, "stiffness": 5.0, "damping": 2.7}
    called, calls = counted(law)
    scenario = dataclasses.replace(WIND, duration=0.5)
    logs = [
        run_in_python(
            dataclasses.replace(scenario, controller=with_safety_layer(each, tight))
        )
        for each in (law, called)
    ]
    assert len(calls) == 100
    for name in ("position", "joints", "rotor_commands", "efforts"):
        assert np.array_equal(getattr(logs[0], name), getattr(logs[1], name))


def test_a_called_law_rests_while_the_recovery_flies_and_starts_anew():
    inner = WIND.controller

    def law(memory, measurement, reference, dt, *, par):
        _, command = inner.law((), measurement, reference, dt, par=par)
        return (memory or 0) + 1, (
            nan(command) if 0.2 <= measurement.time < 0.3 else command
        )

    called, calls = counted(dataclasses.replace(inner, law=law, memory=None))
    calm = dataclasses.replace(
        skyarm.load_scenario("case1"), duration=1.5, initial=None, reference=HOVER
    )
    run(dataclasses.replace(calm, controller=with_safety_layer(called, {"calm": 0.4})))
    silent = np.diff(calls).max()
    # given up at 0.2 s, calm for 0.4 s and asked again in the period after
    assert 0.4 < silent < 0.8
    assert calls[-1] == pytest.approx(1.495)


def test_a_measurement_that_is_not_finite_is_not_shown_to_a_called_law():
    called, calls = counted(WIND.controller)
    guard: Controller = with_safety_layer(called)
    seen = []

    def law(memory, measurement, reference, dt, *, par):
        if 0.05 <= measurement.time < 0.1:
            measurement = dataclasses.replace(measurement, joints=(math.inf, 0.0))
        found = guard.law(memory, measurement, reference, dt, par=par)
        seen.append((memory, *found))
        return found

    flown(dataclasses.replace(guard, law=law), 0.2)
    assert len(calls) == 30
    for before, after, command in seen[10:20]:
        assert after is before
        assert command == before.sent


@pytest.mark.thorough
def test_a_predictive_law_that_turns_the_vehicle_over_is_replaced_by_the_recovery():
    calm = dataclasses.replace(
        skyarm.load_scenario("case1"), duration=3.0, initial=None, reference=HOVER
    )
    law = failing(leaning, 0.1)
    alone, log = (
        run(dataclasses.replace(calm, controller=each))
        for each in (
            law,
            with_safety_layer(law, {"trusted_tilt": 0.3, "patience": 0.05}),
        )
    )
    assert np.abs(alone.euler[:, 1]).max() > 1.0
    assert log.status == "completed"
    assert np.abs(log.euler[:, 1]).max() < 1.0
    assert np.abs(log.euler[-1, :2]).max() < 0.1
