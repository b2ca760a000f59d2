"""Memories before the first measurement: actuators free, a queue as long as the delay,
a channel for each signal.
"""

from __future__ import annotations

import pytest

import skyarm
from skyarm.control.catalogue import make_controller
from skyarm.control.laws.ladder import EXTRAPOLATION, LAG_INVERSION, OBSERVER
from skyarm.control.model import Model
from support.laws import ARM2, MODEL

ARM6 = Model(vehicle=skyarm.load_vehicle("hexarotor_arm6"), gravity=9.81)


@pytest.mark.parametrize("model", [MODEL, ARM6], ids=["arm2", "arm6"])
@pytest.mark.parametrize("delay", [0, 2])
def test_the_centroidal_law_begins_with_free_actuators_and_commands_for_its_delay(
    model, delay
):
    memory = make_controller("centroidal", model, delay=delay * 0.005).memory
    n = model.vehicle.n
    assert memory.free == (1.0,) * (1 + n)
    # and eight steps of the bank of lags
    assert len(memory.past.speeds) == len(memory.past.efforts) == delay + 1 + 8
    assert len(memory.channels) == 4 + n
    assert memory.trim == (0.0,) * len(model.vehicle.rotors)
    assert (memory.started, memory.age) == (0.0, 0.0)


@pytest.mark.parametrize("steps", range(1, LAG_INVERSION + 1))
@pytest.mark.parametrize("delay", [0, 3])
def test_a_stepped_law_remembers_what_its_steps_need_and_nothing_else(steps, delay):
    memory = make_controller(
        "ct_ladder", MODEL, steps=steps, delay_periods=delay
    ).memory
    assert memory.free == ((1.0,) * (1 + ARM2.n) if steps >= OBSERVER else ())
    assert len(memory.sent) == (delay + 1 if steps >= OBSERVER else 0)
    assert len(memory.channels) == (4 + ARM2.n if steps >= EXTRAPOLATION else 0)
    assert (memory.started, memory.age) == (0.0, 0.0)


def test_an_observer_without_an_accelerometer_keeps_nothing_of_one():
    observed = make_controller("ct_ladder", MODEL, steps=OBSERVER).memory.observed
    assert (observed.bias, observed.integrated, observed.joint_residuals) == (
        (),
        (),
        (),
    )
    # that of the flagship has one
    assert (
        make_controller("centroidal", MODEL).memory.observed.joint_residuals
        == (0.0,) * ARM2.n
    )
