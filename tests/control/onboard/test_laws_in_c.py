"""Every law beyond the paper's as C: the bits of Python call after call, libm alone, a
unit for every member.
"""

from __future__ import annotations

import dataclasses
import re

import pytest
from drawn_inputs import inputs, same_bits, text_of

import skyarm
from skyarm.control.catalogue import make_controller
from skyarm.control.controller import preview_leads
from skyarm.control.model import Model
from support.cases import sampled
from support.engines import CAREFUL, LIBM, Loaded, needs_cc, object_file, undefined
from support.laws import PAPER, covering

BEYOND = [law for law in covering() if law not in PAPER and law != "nmpc"]


def controller_of(law):
    return make_controller(
        law, Model(vehicle=skyarm.load_vehicle("hummingbird_arm2"), gravity=9.81)
    )


@needs_cc
@pytest.mark.parametrize(
    "law",
    [
        *sampled([law for law in BEYOND if law != "learned_compensator"], 2),
        pytest.param("learned_compensator", marks=pytest.mark.thorough),
    ],
)
def test_a_law_in_c_has_the_bits_of_python_call_after_call(tmp_path, law):
    controller = controller_of(law)
    text = text_of(controller)
    in_c = Loaded(text, tmp_path, ("-O1", *CAREFUL, "-ffp-contract=off"))
    memory = controller.memory
    for measurement, reference in inputs(
        "hummingbird_arm2", count=12, preview=len(preview_leads(controller.par))
    ):
        memory, command = controller.law(
            memory, measurement, reference, 0.005, par=controller.par
        )
        assert same_bits(
            in_c(measurement, reference),
            [float(x) for x in (*command.rotor_speeds, *command.efforts)],
        )
    assert undefined(object_file(text, tmp_path, ("-O1",), name="alone")) <= LIBM


@pytest.mark.parametrize("law", BEYOND)
def test_every_member_of_every_struct_of_a_law_has_its_unit(law):
    for line in re.findall(
        r"^    double \w+(?:\[\d+\])*;.*$", text_of(controller_of(law)), re.MULTILINE
    ):
        assert re.search(r"/\* .*\S \*/$", line), line


@needs_cc
@pytest.mark.thorough
def test_sideways_force_in_c_has_the_bits_of_python(tmp_path):
    vehicle = skyarm.load_vehicle("tilted_hexarotor")
    controller = make_controller(
        "centroidal",
        Model(vehicle=vehicle),
        sideways=0.9,
        attitude=[0.05, -0.1],
        delay=0.005,
    )
    in_c = Loaded(text_of(controller), tmp_path, ("-O1", *CAREFUL, "-ffp-contract=off"))
    memory = controller.memory
    for measurement, reference in inputs(
        "tilted_hexarotor", count=12, preview=len(preview_leads(controller.par))
    ):
        memory, command = controller.law(
            memory, measurement, reference, 0.005, par=controller.par
        )
        assert same_bits(
            in_c(measurement, reference), [float(x) for x in command.rotor_speeds]
        )


@needs_cc
@pytest.mark.thorough
@pytest.mark.parametrize("sideways", [0.0, 0.9])
def test_a_law_on_rotors_that_tilt_has_the_bits_of_python_in_c(tmp_path, sideways):
    vehicle = skyarm.load_vehicle("voliro_like")
    controller = make_controller(
        "centroidal", Model(vehicle=vehicle), sideways=sideways, delay=0.005
    )
    text = text_of(controller)
    assert re.search(
        r"double tilts\[6\]; /\* rad, angles of the tilting rotors \*/", text
    )
    in_c = Loaded(text, tmp_path, ("-O1", *CAREFUL, "-ffp-contract=off"))
    memory = controller.memory
    for k, (measurement, reference) in enumerate(
        inputs("voliro_like", count=12, preview=len(preview_leads(controller.par)))
    ):
        seen = dataclasses.replace(
            measurement, tilts=tuple(0.01 * k * (i - 2) for i in range(6))
        )
        memory, command = controller.law(
            memory, seen, reference, 0.005, par=controller.par
        )
        sent = [
            float(x) for x in (*command.rotor_speeds, *command.efforts, *command.tilts)
        ]
        assert len(sent) == (14 if sideways else 8)
        assert same_bits(in_c(seen, reference), sent)


@needs_cc
@pytest.mark.parametrize("inertia", [0.0, 0.2])
def test_instructions_of_a_team_and_the_force_at_the_tip_are_in_c(tmp_path, inertia):
    vehicle = skyarm.load_vehicle("hummingbird_arm2")
    options = {"mode": "tip", "carrying": 0.7, "carried_inertia": inertia}
    controller = make_controller("centroidal", Model(vehicle=vehicle), **options)
    text = text_of(controller)
    assert re.search(r"double carry\[27\];", text)
    assert "Memory, parts, carrying: estimated force (N) and moment (N m)" in text
    in_c, memory = (
        Loaded(text, tmp_path, ("-O1", *CAREFUL, "-ffp-contract=off")),
        controller.memory,
    )
    rows = inputs(
        "hummingbird_arm2", count=12, preview=len(preview_leads(controller.par))
    )
    for k, (measurement, reference) in enumerate(rows):
        carry = (
            float(k > 4),
            *(0.01 * k * (i - 9.0) for i in range(24)),
            5.0,
            0.02 * k,
        )
        given = dataclasses.replace(reference, carry=carry)
        memory, command = controller.law(
            memory, measurement, given, 0.005, par=controller.par
        )
        assert same_bits(
            in_c(measurement, given),
            [float(x) for x in (*command.rotor_speeds, *command.efforts)],
        )
