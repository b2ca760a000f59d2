"""An exported controller in C gives the command of the law in Python: every law and
preset, parameters, NaN, memory.
"""

from __future__ import annotations

import dataclasses
import re
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from drawn_inputs import inputs, same_bits, text_of
from exported_sizes import built, nanoseconds_of, stack_of

import skyarm
from skyarm.algebra import Vec3
from skyarm.cli.export_command import _at_rate, _changes_in_flight
from skyarm.cli.main import main
from skyarm.control.blocks.disturbance_observer import Observed
from skyarm.control.catalogue import PRESETS, Controller, make_controller
from skyarm.control.controller import preview_leads
from skyarm.control.laws.centroidal.law import CentroidalMemory
from skyarm.control.model import Model, Terms
from skyarm.control.onboard.export_c import STRUCTS, Constants, _member, export_c
from skyarm.control.safety import with_safety_layer
from skyarm.dynamics.actuators import Command
from skyarm.records.leaves import leaves, rebuild
from skyarm.records.units import units
from skyarm.world import TimedPayload
from support.cases import sampled
from support.engines import (
    CAREFUL,
    CC,
    LIBM,
    STRICT,
    Loaded,
    needs_cc,
    object_file,
    run,
    undefined,
)
from support.flights import TEXT
from support.laws import G, step

PAPER_LAWS = ("rotors_sim_position", "decoupled_pd", "hybrid_computed_torque")

NATIVE = ("-march=native", "-ffp-contract=off")
VEHICLES = ("hummingbird_arm2", "hexarotor_arm6")
FITTING = {
    "hummingbird_arm2": (*PAPER_LAWS, *PRESETS),
    "hexarotor_arm6": (
        "rotors_sim_position",
        "decoupled_pd",
        "hybrid_computed_torque",
        "rotors_sim_hummingbird",
    ),
}
PAIRS = [(vehicle, name) for vehicle in VEHICLES for name in FITTING[vehicle]]


def expected(controller: Controller, measurement, reference) -> list[float]:
    command = step(controller, measurement, reference)
    return [float(x) for x in (*command.rotor_speeds, *command.efforts)]


class InPython:
    """The law in Python floats, call after call."""

    def __init__(self, controller: Controller) -> None:
        self.controller, self.memory = controller, controller.memory

    def __call__(self, measurement, reference) -> list[float]:
        law, par = self.controller.law, self.controller.par
        self.memory, command = law(self.memory, measurement, reference, 0.005, par=par)
        return [float(x) for x in (*command.rotor_speeds, *command.efforts)]


@needs_cc
@pytest.mark.parametrize(("vehicle", "name"), sampled(PAIRS, 6))
def test_every_law_and_preset_has_the_bits_of_the_law_in_python(
    tmp_path, vehicle, name
):
    """1e-12 is asked for; without contraction the same operations in the same order
    leave no difference at all.
    """
    controller = built(vehicle, name)
    in_c = Loaded(text_of(controller), tmp_path, ("-O2", *CAREFUL, "-ffp-contract=off"))
    in_python = InPython(controller)
    for pair in inputs(vehicle, preview=len(preview_leads(controller.par))):
        wanted, found = in_python(*pair), in_c(*pair)
        np.testing.assert_allclose(found, wanted, rtol=1e-12, atol=1e-12)
        assert same_bits(found, wanted)


@needs_cc
@pytest.mark.parametrize(
    "flags", [("-O0",), ("-O3", "-march=native", "-ffp-contract=fast")], ids=" ".join
)
def test_optimisation_changes_no_bit_and_contraction_is_taken_back(tmp_path, flags):
    controller = built("hummingbird_arm2", "paper_ct")
    in_c = Loaded(text_of(controller), tmp_path, flags)
    for measurement, reference in inputs("hummingbird_arm2"):
        assert same_bits(
            in_c(measurement, reference), expected(controller, measurement, reference)
        )
    lost = dataclasses.replace(measurement, position=Vec3(float("nan"), 0.0, 1.0))
    assert np.isnan(in_c(lost, reference)[:4]).all()


@needs_cc
@pytest.mark.parametrize("mixer", ["clip", "priority"])
def test_structure_is_folded_in_mixers_rate_errors_and_ablations(tmp_path, mixer):
    model = Model(vehicle=skyarm.load_vehicle("hexarotor_arm6"), gravity=9.7)
    terms = Terms(coriolis=False, feedforward=False)
    controller = make_controller(
        "hybrid_computed_torque",
        model,
        mixer_policy=mixer,
        rate_error="corrected",
        terms=terms,
    )
    text = text_of(controller)
    in_c = Loaded(text, tmp_path)
    for pair in inputs("hexarotor_arm6"):
        assert same_bits(in_c(*pair), expected(controller, *pair))


@needs_cc
def test_parameters_may_change_at_run_time_and_the_defaults_stay(tmp_path):
    controller = built("hummingbird_arm2", "hybrid_computed_torque")
    in_c = Loaded(text_of(controller), tmp_path)
    own = in_c.copy_of_parameters()
    own.base_mass, own.link1_mass, own.gravity = 1.1, 0.09, 9.7
    own.base_inertia_yy, own.link0_com_z = 0.011, -0.08
    own.link1_joint_position_z, own.link0_joint_effort_limit = -0.16, 0.3
    own.gains_position[2], own.gains_rate[1] = 6.5, 0.2
    own.joint_gains_damping[1], own.mixer_inverse[3][2] = (
        17.0,
        1.5 * own.mixer_inverse[3][2],
    )
    par = controller.par
    vehicle, mixer = par.model.vehicle, [list(row) for row in par.mixer.inverse]
    upper, lower = vehicle.links
    base = dataclasses.replace(
        vehicle.base,
        mass=1.1,
        inertia=dataclasses.replace(vehicle.base.inertia, yy=0.011),
    )
    com = dataclasses.replace(upper.body.com, z=-0.08)
    hinge = dataclasses.replace(
        lower.joint, position=dataclasses.replace(lower.joint.position, z=-0.16)
    )
    weak = dataclasses.replace(upper.joint, effort_limit=0.3)
    links = (
        dataclasses.replace(
            upper, joint=weak, body=dataclasses.replace(upper.body, com=com)
        ),
        dataclasses.replace(
            lower, joint=hinge, body=dataclasses.replace(lower.body, mass=0.09)
        ),
    )
    mixer[3][2] *= 1.5
    gains = dataclasses.replace(
        par.gains,
        position=dataclasses.replace(par.gains.position, z=6.5),
        rate=dataclasses.replace(par.gains.rate, y=0.2),
    )
    changed_par = dataclasses.replace(
        par,
        model=Model(
            vehicle=dataclasses.replace(vehicle, base=base, links=links), gravity=9.7
        ),
        gains=gains,
        joint_gains=dataclasses.replace(
            par.joint_gains, damping=(par.joint_gains.damping[0], 17.0)
        ),
        mixer=dataclasses.replace(par.mixer, inverse=tuple(map(tuple, mixer))),
    )
    heavier = dataclasses.replace(controller, par=changed_par)
    # the last asks for nothing, whatever the parameters
    for pair in list(inputs("hummingbird_arm2"))[:-1]:
        assert same_bits(in_c(*pair, own), expected(heavier, *pair))
        assert same_bits(in_c(*pair), expected(controller, *pair))
        assert not same_bits(in_c(*pair, own), in_c(*pair))


@needs_cc
@pytest.mark.parametrize("name", ["paper_ct", "paper_pd", "rotors_sim_hummingbird"])
def test_a_nan_goes_where_it_goes_in_python(tmp_path, name):
    controller = built("hummingbird_arm2", name)
    in_c = Loaded(text_of(controller), tmp_path)
    measurement, reference = next(inputs("hummingbird_arm2"))
    split = len(leaves(measurement))
    values = [*leaves(measurement), *leaves(reference)]
    spoilt = 0
    for i in range(len(values)):
        with_nan = [*values[:i], float("nan"), *values[i + 1 :]]
        pair = (
            rebuild(measurement, iter(with_nan[:split])),
            rebuild(reference, iter(with_nan[split:])),
        )
        found = in_c(*pair)
        assert same_bits(found, expected(controller, *pair))
        spoilt += any(np.isnan(found))
        if 1 <= i <= 7:  # position and quaternion reach every rotor
            assert np.isnan(found[:4]).all()
    # pose, velocities; position, velocity and heading of the reference
    assert spoilt >= 13 + 7


@dataclasses.dataclass(frozen=True, kw_only=True, slots=True)
class Memory:
    total: Vec3
    calls: float


def integrating(memory, measurement, reference, dt, *, par):
    """Speed from an integral, to exercise memory and period; the new memory needs the
    old one in another order.

    Source: none.
    """
    error = reference.position - measurement.position
    total = Vec3(memory.total.y, memory.total.x, memory.total.z) + error * dt
    speeds = tuple(total.x * 3.0 + memory.calls for _ in par.model.vehicle.rotors)
    return Memory(total=total, calls=memory.calls + 1.0), Command(
        rotor_speeds=speeds, efforts=(0, total.y)
    )


@needs_cc
def test_a_law_with_memory_keeps_it_in_its_struct_and_reads_the_period(tmp_path):
    par = built("hummingbird_arm2", "paper_pd").par
    start = Memory(total=Vec3(0.1, -0.2, 0.0), calls=5.0)
    controller = Controller(name="integrating", law=integrating, par=par, memory=start)
    exported = export_c(controller, name="law", period=0.01)
    assert exported.parameters == ("period",)
    in_c = Loaded(exported.text, tmp_path)
    slower = in_c.copy_of_parameters()
    slower.period = 0.02
    memory = start
    for index, (measurement, reference) in enumerate(inputs("hummingbird_arm2")):
        dt = 0.02 if index % 2 else 0.01
        memory, command = integrating(memory, measurement, reference, dt, par=par)
        wanted = [float(x) for x in (*command.rotor_speeds, *command.efforts)]
        assert same_bits(
            in_c(measurement, reference, slower if index % 2 else None), wanted
        )
        assert same_bits([*in_c.memory.total, in_c.memory.calls], leaves(memory))


@needs_cc
def test_single_precision_is_near(tmp_path):
    """1e-4 of a command's size: 618 operations of 6e-8 each, and the conditioning of
    the attitude error.

    Rotors are compared by the squares of their speeds, which the mixer sums, against
    that of the highest: the root of a difference of large squares has few digits left
    where a rotor nearly stands.
    """
    controller = built("hummingbird_arm2", "paper_ct")
    text = text_of(controller, single=True)
    assert not re.search(r"\bdouble [a-z]", text)
    in_c = Loaded(text, tmp_path, ("-O2", *CAREFUL))
    for pair in inputs("hummingbird_arm2"):
        wanted = np.array(expected(controller, *pair))
        found = np.array(in_c(*pair))
        np.testing.assert_allclose(
            found[:4] ** 2, wanted[:4] ** 2, rtol=1e-4, atol=1e-6 * 838.0**2
        )
        np.testing.assert_allclose(found[4:], wanted[4:], rtol=1e-4, atol=1e-4)


@needs_cc
@pytest.mark.parametrize(
    ("vehicle", "name"), sampled([p for p in PAIRS if p[1] in PAPER_LAWS], 2)
)
def test_only_libm_is_needed_and_the_stack_is_bounded(
    tmp_path, vehicle, name, record_property
):
    """The bound is a quarter of a microcontroller's usual 16 KiB; the number itself is
    reported.
    """
    target = object_file(text_of(built(vehicle, name)), tmp_path, ("-O2",))
    assert undefined(target) <= LIBM
    largest = stack_of(text_of(built(vehicle, name)), tmp_path / "usage")
    if largest is None:
        pytest.skip("this compiler does not report stack use")
    record_property(f"stack bytes of {name} on {vehicle}", largest)
    print(f"stack of {name} on {vehicle}: {largest} bytes")
    # the paper's laws leave room on a microcontroller; a law of thousands of operations
    # asks for a larger stack
    assert largest <= (4096 if name in PAPER_LAWS else 32768)


@needs_cc
def test_latency_is_reported(tmp_path, record_property):
    """A measurement of this machine, not a promise: nothing is asserted on it."""
    nanoseconds = nanoseconds_of(
        built("hummingbird_arm2", "paper_ct"), "hummingbird_arm2", tmp_path
    )
    record_property("ns per step", nanoseconds)
    print(f"paper_ct on hummingbird_arm2: {nanoseconds:.0f} ns a step")


@needs_cc
def test_two_controllers_link_into_one_program_by_their_declarations(tmp_path):
    names = ("paper_ct", "paper_pd")
    texts = {name: text_of(built("hummingbird_arm2", name), name) for name in names}
    objects = [object_file(text, tmp_path, name=name) for name, text in texts.items()]
    user = "".join(
        f'#define {n.upper()}_INTERFACE_ONLY\n#include "{n}.c"\n#include "{n}.c"\n'
        for n in names
    )
    user += "#include <stdio.h>\nint main(void)\n{\n"
    measurement, reference = next(inputs("hummingbird_arm2"))
    for name in names:
        for key, record in (("measurement", measurement), ("reference", reference)):
            rows = []
            (struct,) = re.findall(
                rf"^struct {name}_{key} {{\n(.*?)^}};",
                texts[name],
                re.DOTALL | re.MULTILINE,
            )
            members = re.findall(r"^    double (\w+)", struct, re.MULTILINE)
            for field in dataclasses.fields(record):
                held = getattr(record, field.name)
                if field.name not in members:
                    assert held == (), (
                        f"{key}.{field.name}: a struct lacks a member only for what"
                        " there is none of"
                    )
                    continue
                rows.append(
                    "{" + (", ".join(map(repr, held)) or "0.0") + "}"
                    if hasattr(held, "__iter__")
                    else repr(held)
                )
            user += (
                f"    const struct {name}_{key} {name}_{key[0]} ="
                f" {{{', '.join(rows)}}};\n"
            )
        user += (
            f"    struct {name}_memory {name}_k = {name}_first_memory;\n    struct"
            f" {name}_command {name}_c;\n"
        )
    for name in names:
        user += f"    {name}_step(&{name}_m, &{name}_r, &{name}_k, &{name}_c);\n"
        user += (
            f'    printf("%.17g %.17g\\n", {name}_c.rotor_speeds[2],'
            f" {name}_c.efforts[1]);\n"
        )
    user += "    return 0;\n}\n"
    target = object_file(user, tmp_path, name="main")
    program = tmp_path / "program"
    run(CC, target, *objects, "-lm", "-o", program)
    printed = [float(x) for x in run(program).split()]
    wanted = []
    for name in names:
        command = expected(built("hummingbird_arm2", name), measurement, reference)
        wanted += [command[2], command[5]]
    assert printed == wanted


@needs_cc
def test_a_build_whose_constants_are_not_doubles_ends_in_an_error_with_the_flag(
    tmp_path,
):
    """Without it the file would compute with numbers of 24 bits; a file in float takes
    the flag.
    """
    for single, flags, code in (
        (False, ["-fsingle-precision-constant"], 1),
        (True, ["-fsingle-precision-constant"], 0),
        (False, [], 0),
    ):
        (tmp_path / "law.c").write_text(
            text_of(built("hummingbird_arm2", "paper_ct"), single=single)
        )
        compiler = [CC, "-std=c99", *flags, "-c", "law.c", "-o", "law.o"]
        done = subprocess.run(
            compiler, cwd=tmp_path, capture_output=True, text=True, check=False
        )
        assert done.returncode == code, (flags, done.stderr)
        assert (
            "law_needs_64_bit_double_without_fsingle_precision_constant" in done.stderr
        ) is bool(code)


@needs_cc
def test_the_file_is_c_plus_plus_too(tmp_path):
    compiler = shutil.which("c++")
    if compiler is None:
        pytest.skip("no C++ compiler 'c++' on this machine")
    (tmp_path / "law.c").write_text(
        text_of(built("hexarotor_arm6", "hybrid_computed_torque"))
    )
    flags = [flag for flag in STRICT if not flag.startswith("-std")]
    run(
        compiler,
        *flags,
        "-std=c++11",
        "-x",
        "c++",
        "-c",
        tmp_path / "law.c",
        "-o",
        tmp_path / "law.o",
    )
    assert {"law_step", "law_step_with"} <= set(
        re.findall(r"\bT _?(\w+)", run("nm", tmp_path / "law.o"))
    )


@needs_cc
def test_the_programs_of_the_guide_print_what_the_guide_shows(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    guide = (Path(__file__).parents[3] / "docs" / "export_c.md").read_text("utf-8")
    programs = re.findall(r"```c title=\"(\w+).c\"\n(.*?)```", guide, re.DOTALL)
    shown = re.findall(
        r"^<!-- not printed: of a C compiler.*?\n```text\n(.*?)```", guide, re.M | re.S
    )
    arguments = ["skyarm", "export", "case3", "--to", "c", "-o", "case3.c"]
    monkeypatch.setattr(sys, "argv", arguments)
    with pytest.raises(SystemExit) as stop:
        main()
    assert stop.value.code == 0
    examples = Path(__file__).parents[3] / "examples"
    capsys.readouterr()
    runpy.run_path(str(examples / "record_for_c.py"))  # writes flown.h
    assert capsys.readouterr().out == shown[1]
    law = object_file(Path("case3.c").read_text("ascii"), tmp_path, name="case3")
    assert [name for name, _ in programs] == ["main", "check"]
    for (name, program), printed in zip(programs, shown, strict=True):
        own = object_file(program, tmp_path, ("-O2", *CAREFUL), name=name)
        run(CC, own, law, "-lm", "-o", tmp_path / name)
        assert run(tmp_path / name) == printed


def test_operations_and_parameters_of_the_table_are_current():
    table = (Path(__file__).parents[3] / "docs" / "data" / "export_c.md").read_text(
        "utf-8"
    )
    rows = re.findall(
        r"^\| `(\w+)` on `(\w+)` \| (\d+) \| (\d+) \|", table, re.MULTILINE
    )
    assert len(rows) >= 2
    for name, vehicle, operations, parameters in rows:
        exported = export_c(built(vehicle, name), name="law", period=0.005)
        # a formula may be sharpened without a new table; another order of size is worth
        # one
        assert exported.operations == pytest.approx(int(operations), rel=0.15)
        assert len(exported.parameters) == int(parameters)


@pytest.mark.parametrize(("vehicle", "name"), PAIRS)
def test_every_member_of_every_struct_has_its_unit(vehicle, name):
    text = text_of(built(vehicle, name))
    lines = re.findall(r"^    double \w+(?:\[\d+\])*;.*$", text, re.MULTILINE)
    assert len(lines) > 30
    for line in lines:
        assert re.search(r"/\* .*\S \*/$", line), line


def test_comments_are_what_the_fields_say_of_themselves():
    text = text_of(built("hummingbird_arm2", "centroidal_tip"))
    for member, kind, field in (
        ("base_mass", skyarm.Body, "mass"),
        ("base_inertia_xx", skyarm.Body, "inertia"),
        ("rotors_0_time_constant_up", skyarm.Rotor, "time_constant_up"),
        ("gravity", Model, "gravity"),
        ("period", Constants, "period"),
        ("age", CentroidalMemory, "age"),
        ("observed_force[3]", Observed, "force"),
        ("specific_force[3]", skyarm.Measurement, "specific_force"),
        ("rotor_speeds[4]", Command, "rotor_speeds"),
    ):
        assert f" {member}; /* {units(kind)[field].words} */" in text, member
    assert set(STRUCTS) == {
        "measurement",
        "reference",
        "memory",
        "command",
        "parameters",
    }


def test_torque_gains_and_acceleration_gains_have_their_own_units():
    assert "joint_gains_stiffness[2]; /* N m/rad or N/m" in text_of(
        built("hummingbird_arm2", "paper_pd")
    )
    assert "joint_gains_stiffness[2]; /* 1/s^2" in text_of(
        built("hummingbird_arm2", "paper_ct")
    )


def test_a_safety_layer_says_its_units_and_those_of_the_gains_inside():
    model = Model(vehicle=skyarm.load_vehicle("hummingbird_arm2"), gravity=G)
    for law, unit in (
        ("decoupled_pd", "N m/rad or N/m"),
        ("hybrid_computed_torque", "1/s^2"),
    ):
        text = text_of(with_safety_layer(make_controller(law, model)))
        for line in re.findall(r"^    double \w+(?:\[\d+\])*;.*$", text, re.MULTILINE):
            assert re.search(r"/\* .*\S \*/$", line), line
        assert (
            "recovery_joint_gains_stiffness[2]; /* N m/rad or N/m, effort per error"
            in text
        )
        assert f" inner_joint_gains_stiffness[2]; /* {unit}, " in text


def test_the_opening_says_when_the_samples_to_come_are():
    flagship = built("hummingbird_arm2", "centroidal_tip")
    leads = ", ".join(f"{lead:.4g}" for lead in preview_leads(flagship.par))
    opening = text_of(flagship).split("*/")[0]
    assert f"of each of the instants {leads} s after the sample that is held" in opening
    assert leads.startswith("0.02, 0.04, ")
    assert (
        "samples to come"
        not in text_of(built("hummingbird_arm2", "paper_ct")).split("*/")[0]
    )
    assert "ahead" not in text_of(built("hummingbird_arm2", "paper_ct"))


def test_the_opening_names_law_source_vehicle_joints_rotors_and_how_to_compile():
    text = text_of(built("hummingbird_arm2", "bulut2019")).split("*/")[0]
    for words in (
        "controller 'bulut2019' for the vehicle 'hummingbird_arm2'",
        "Generated by skyarm: ",
        "Source: ",
        "Not defined at: pitch near 90 degrees",
        "joint 1: joint2 of link 1 'link2', revolute, rad, N m",
        "rotor 0: front, cw, at [0.17, 0, 0] m",
        "once every 0.005 s or at another rate: this law has no clock.",
        "cc -std=c99 -O2 -c law.c",
        "World z up",
    ):
        assert words in text, words


def test_a_law_with_a_clock_is_called_at_its_own_rate():
    text = text_of(built("hummingbird_arm2", "centroidal_tip")).split("*/")[0]
    assert "Call law_step once every 0.005 s.\n" in text


@pytest.mark.parametrize(
    ("path", "name"),
    [
        (("parameters", "model", "vehicle", "base", "mass"), "base_mass"),
        (
            ("parameters", "model", "vehicle", "links", "0", "body", "mass"),
            "link0_mass",
        ),
        (("parameters", "gains", "links", "1", "axis"), "gains_link1_axis"),
        (("parameters", "rotors", "2", "inertia"), "rotors_2_inertia"),
        (("parameters", "0"), "value0"),
    ],
)
def test_a_member_is_named_by_its_path(path, name):
    assert _member(path) == name


@needs_cc
def test_a_vehicle_s_words_cannot_break_the_comment(tmp_path):
    controller = built("hummingbird_arm2", "paper_pd")
    vehicle = dataclasses.replace(
        controller.par.model.vehicle, title="a */ b /* c ??/ d \\\ne \u00e9 //"
    )
    par = dataclasses.replace(controller.par, model=Model(vehicle=vehicle, gravity=G))
    text = text_of(dataclasses.replace(controller, par=par))
    assert text.isascii()
    object_file(text, tmp_path)


def test_the_same_controller_gives_the_same_file():
    assert text_of(built("hexarotor_arm6", "decoupled_pd")) == text_of(
        built("hexarotor_arm6", "decoupled_pd")
    )


@pytest.mark.parametrize("name", ["", "9a", "a-b", "a b", "_a", "a" * 65, "\u00e9"])
def test_a_name_that_is_no_identifier_is_refused(name):
    with pytest.raises(ValueError, match="must be letters, digits and _"):
        text_of(built("hummingbird_arm2", "paper_pd"), name)


def command(monkeypatch, capsys, *arguments: str):
    monkeypatch.setattr(sys, "argv", ["skyarm", "export", "--to", "c", *arguments])
    with pytest.raises(SystemExit) as stop:
        main()
    return stop.value.code or 0, capsys.readouterr()


def test_the_command_writes_the_file_and_says_so(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    code, said = command(
        monkeypatch,
        capsys,
        "paper_ct",
        "--vehicle",
        "hummingbird_arm2",
        "-o",
        "made/ct.c",
    )
    assert (code, said.err) == (0, "")
    assert re.fullmatch(
        r"made/ct\.c: paper_ct_step, hybrid_computed_torque for hummingbird_arm2\n\d+"
        r" operations in double, "
        r"\d+ parameters\n",
        said.out.replace("\\", "/"),
    )
    assert [p.name for p in (tmp_path / "made").iterdir()] == ["ct.c"], (
        "no temporary file is left"
    )
    generator = f"skyarm {skyarm.__version__}"
    controller = built("hummingbird_arm2", "paper_ct")
    expected_text = export_c(
        controller, name="paper_ct", period=1.0 / 200.0, generator=generator
    ).text
    assert f"Generated by {generator}: " in expected_text
    assert (tmp_path / "made" / "ct.c").read_text() == expected_text


def test_the_options_reach_the_file(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    options = ("--gravity", "9.7", "--rate", "400", "--name", "mine", "--float32")
    code, said = command(
        monkeypatch,
        capsys,
        "decoupled_pd",
        "--vehicle",
        "hexarotor_arm6",
        *options,
        "-o",
        "x.c",
    )
    assert code == 0
    assert said.err == ""
    assert "operations in float" in said.out
    text = (tmp_path / "x.c").read_text()
    assert "    9.69999981f, /* gravity */\n" in text
    assert "void mine_step(" in text
    assert "once every 0.0025 s" in text


@needs_cc
def test_a_scenario_is_exported_as_it_flies(tmp_path, monkeypatch, capsys):
    scenario = (
        'name = "my-flight"\nduration = 1.0\n[rates]\nphysics = 1000\ncontrol ='
        ' 500\n[plant]\nvehicle = "hummingbird_arm2_rotors"\n[model]\nvehicle ='
        ' "hummingbird_arm2"\ngravity = 9.7\n[controller]\nlaw ='
        ' "hybrid_computed_torque"\nmixer = "priority"\nwithout ='
        ' ["coriolis"]\njoint_gains = { stiffness = [200, 100], damping = [11, 9]'
        ' }\n[reference.base]\nkind = "hover"\nposition = [0, 0, 1]\n'
    )
    monkeypatch.chdir(tmp_path)
    (tmp_path / "f.toml").write_text(scenario)
    code, said = command(monkeypatch, capsys, "f.toml", "-o", "f.c")
    assert (code, said.err) == (0, "")
    text = (tmp_path / "f.c").read_text()
    assert "once every 0.002 s" in text
    controller = skyarm.load_scenario("f.toml").controller
    in_c = Loaded(text, tmp_path, name="my_flight")
    for pair in inputs("hummingbird_arm2"):
        assert same_bits(in_c(*pair), expected(controller, *pair))


DELAYED = """
name = "late"
duration = 1.0
delays = { measurement = 0.01 }
rates = { RATES }
model = { vehicle = "hummingbird_arm2" }
plant = { vehicle = "hummingbird_arm2_rotors" }
controller = { preset = "centroidal_tip" }
[reference.base]
kind = "hover"
position = [0, 0, 1]
"""


@pytest.mark.parametrize(
    ("rate", "rates"),
    [("500", "control = 500"), ("400", "physics = 1200, control = 400")],
)
def test_a_scenario_at_another_rate_is_the_one_that_holds_this_rate(
    tmp_path, monkeypatch, capsys, rate, rates
):
    """Law, first memory and delays in periods, to the letter; the physics follows where
    it must be a multiple.
    """
    monkeypatch.chdir(tmp_path)
    texts = []
    for held, options in (("control = 200", ("--rate", rate)), (rates, ())):
        (tmp_path / "late.toml").write_text(DELAYED.replace("RATES", held))
        code, said = command(monkeypatch, capsys, "late.toml", *options, "-o", "x.c")
        assert (code, said.err) == (0, "")
        texts.append((tmp_path / "x.c").read_text())
    assert texts[0] == texts[1]


@pytest.mark.parametrize("rate", [40, 125, 333, 1000])
def test_the_rate_of_the_reference_gives_way_to_another_control_rate(rate):
    found = _at_rate("case1", float(rate), skyarm.load_scenario("case1").rates).rates
    assert (found.control, found.physics % rate, rate % found.reference) == (rate, 0, 0)


def test_a_rate_that_the_scenario_s_sensors_do_not_allow_is_one_line(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "f.toml").write_text(TEXT)
    code, said = command(monkeypatch, capsys, "f.toml", "--rate", "500", "-o", "x.c")
    assert code == 2
    assert said.err.startswith("skyarm: --rate = 500.0: ")
    assert (
        "estimator.delay_periods: lags 0.004 s, must be at least sensors.mocap.latency"
        " = 0.01 s" in said.err
    )


@pytest.mark.parametrize(
    "path",
    [
        "controller.gains.position.z",
        "model.payload.mass",
        "estimator.gyro",
        "plant.gravity",
    ],
)
def test_changes_in_flight_of_what_is_exported_are_noted_on_terminal_and_in_file(
    tmp_path, monkeypatch, capsys, path
):
    monkeypatch.chdir(tmp_path)
    changed = TEXT.replace('preset = "centroidal_tip"', 'preset = "paper_ct"')
    (tmp_path / "f.toml").write_text(
        f"{changed}\n[[changes]]\nat = 0.5\npath = '{path}'\nvalue = 1.0\n"
    )
    code, said = command(monkeypatch, capsys, "f.toml", "-o", "x.c")
    assert (code, said.err) == (0, "")
    words, noted = "without its changes in flight", path != "plant.gravity"
    assert (words in " ".join(said.out.split())) is noted
    assert (words in (tmp_path / "x.c").read_text().split("*/")[0]) is noted


def test_a_believed_payload_of_a_waiting_phase_counts_as_a_change_in_flight():
    scenario = skyarm.load_scenario("case3")
    payload = TimedPayload(name="parcel", mass=0.1, pick=0.2, drop=0.4, believed=True)
    assert not _changes_in_flight(scenario)
    assert _changes_in_flight(
        scenario.with_agent(dataclasses.replace(scenario.agent, payloads=(payload,)))
    )


ERRORS = [
    (
        ("nope", "--vehicle", "hummingbird_arm2"),
        ("controller = 'nope'", "nmpc", "'skyarm show' shows all"),
    ),
    (("nope",), ("controller = 'nope'", "nmpc")),
    (("gone.toml",), ("gone.toml",)),
    (("paper_ct",), ("--vehicle", "is missing", "'paper_ct'")),
    (("paper_ct", "--vehicle", "nope"), ("vehicle = 'nope'", "hexarotor_arm6")),
    (
        ("paper_ct", "--vehicle", "hexarotor_arm6"),
        ("joint_gains.stiffness", "2 values", "must be 6"),
    ),
    (
        ("case3", "--vehicle", "hummingbird_arm2"),
        ("--vehicle", "must be left out", "case3"),
    ),
    (("case3", "--gravity", "9.7"), ("--gravity = 9.7", "must be left out")),
    (
        ("paper_ct", "--vehicle", "hummingbird_arm2", "--rate", "0"),
        ("--rate = 0.0", "above 0"),
    ),
    (
        ("paper_ct", "--vehicle", "hummingbird_arm2", "--rate", "nan"),
        ("--rate = nan", "finite"),
    ),
    (
        ("paper_ct", "--vehicle", "hummingbird_arm2", "--gravity", "-1"),
        ("--gravity = -1.0", "at least 0"),
    ),
    (
        ("paper_ct", "--vehicle", "hummingbird_arm2", "--name", "9"),
        ("name = '9'", "letters"),
    ),
]


@pytest.mark.parametrize(("arguments", "words"), ERRORS)
def test_wrong_input_is_one_line_and_no_file(
    tmp_path, monkeypatch, capsys, arguments, words
):
    monkeypatch.chdir(tmp_path)
    code, said = command(monkeypatch, capsys, *arguments, "-o", "x.c")
    assert code == 2
    assert said.err.count("\n") == 1
    assert said.err.startswith("skyarm: ")
    for word in words:
        assert word in said.err, (word, said.err)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("target", ["folder", "file/x.c", "", "/dev/null/x.c"])
def test_a_place_that_cannot_be_written_is_one_line(
    tmp_path, monkeypatch, capsys, target
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("kept")
    code, said = command(monkeypatch, capsys, "case1", "-o", target)
    assert code == 2
    assert said.err.count("\n") == 1
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "folder"]
    assert (tmp_path / "file").read_text() == "kept"
