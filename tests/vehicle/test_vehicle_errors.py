"""A wrong vehicle file is refused with one line: file, field, value, what is
allowed.
"""

import copy
import math
import random

import pytest
from vehicle_documents import DOCUMENT, file_of

from skyarm.vehicle import VehicleError, description
from skyarm.vehicle.vehicle_files import list_vehicles, load_vehicle


def changed(path, value):
    """The example with one field set (or taken out, for None)."""
    document = copy.deepcopy(DOCUMENT)
    *steps, last = path
    table = document
    for step in steps:
        table = table[step]
    if value is None:
        del table[last]
    else:
        table[last] = value
    return document


def refusal(path):
    with pytest.raises(VehicleError) as error:
        load_vehicle(path)
    text = str(error.value)
    assert "\n" not in text
    return text


ARM, JOINT, FRONT = ("links", 0), ("links", 0, "joint"), ("rotors", 0)
CASES = [
    # path, value, field in the message, what it must say
    (("mas",), 1.0, "mas = 1.0", "unknown field; allowed: schema, mimic, urdf"),
    (
        ("base", "weight"),
        1.0,
        "base.weight = 1.0",
        "unknown field; allowed: parts, mass, com, inertia, planar",
    ),
    (
        (*JOINT, "axes"),
        1,
        "links[arm].joint.axes = 1",
        "unknown field; did you mean 'axis'? allowed: ",
    ),
    (
        (*FRONT, "thrust"),
        1,
        "rotors[front].thrust = 1",
        "unknown field; did you mean 'max_thrust'? allowed: ",
    ),
    (("schema",), 2, "schema = 2", "must be 1"),
    (("schema",), None, "schema: is missing", ""),
    (("name",), 3, "name = 3", "must be text"),
    (("name",), "", "name = ''", "must be text that is not empty"),
    (("base",), None, "base: is missing", ""),
    (("base",), 1.0, "base = 1.0", "must be a table"),
    (("links",), 1.0, "links = 1.0", "must be a list of tables"),
    (("base", "mass"), "heavy", "base.mass = 'heavy'", "must be a finite number, kg"),
    (("base", "mass"), True, "base.mass = True", "must be a finite number, kg"),
    (("base", "mass"), -0.7, "base.mass = -0.7", "must be at least 0, kg"),
    (("base", "mass"), math.nan, "base.mass = nan", "must be a finite number, kg"),
    (("base", "mass"), math.inf, "base.mass = inf", "must be a finite number, kg"),
    (("base", "mass"), None, "base.mass: is missing", ""),
    (("base", "com"), [0.0, 0.0], "base.com = [0.0, 0.0]", "must be three numbers"),
    (("base", "com"), [0.0, "a", 0.0], "base.com[1] = 'a'", "must be a finite number"),
    (
        ("base", "com"),
        [0.0, math.nan, 0.0],
        "base.com[1] = nan",
        "must be a finite number",
    ),
    (
        ("base", "inertia"),
        [1.0, 1.0, 3.0],
        "base.inertia = 'principal moments 1, 1, 3'",
        "triangle inequality",
    ),
    (
        ("base", "inertia"),
        [1.0, 1.0, -1.0],
        "base.inertia = 'principal moments -1",
        "must not be negative",
    ),
    (
        ("base", "inertia"),
        [1.0, 1.0, 1.0, 2.0, 0.0, 0.0],
        "base.inertia",
        "must not be negative",
    ),
    (
        ("base", "inertia"),
        [1.0, 1.0, 1.0, 1.0],
        "base.inertia = [1.0, 1.0, 1.0, 1.0]",
        "three (xx yy zz) or six",
    ),
    (
        ("base", "parts", 0, "mass"),
        -1.0,
        "base.parts[camera].mass = -1.0",
        "must be at least 0, kg",
    ),
    (
        ("base", "parts", 0, "inertia"),
        [1.0, 1.0, 3.0],
        "base.parts[camera].inertia",
        "triangle inequality",
    ),
    (
        (*ARM, "inertia"),
        [1e-4, 1e-4, 3e-4],
        "links[arm].inertia",
        "triangle inequality",
    ),
    ((*ARM, "parent"), "wing", "links[arm].parent = 'wing'", "must be base"),
    (
        (*ARM, "parent"),
        "arm",
        "links[arm].parent = 'arm'",
        "closed chains are not supported (arm -> arm)",
    ),
    (
        (*ARM, "parent"),
        ["base", "arm"],
        "links[arm].parent = ['base', 'arm']",
        "closed chains are not supported",
    ),
    ((*ARM, "parent"), None, "links[arm].parent: is missing", ""),
    ((*ARM, "name"), "base", "links.name = 'base'", "is the airframe's name"),
    ((*ARM, "joint"), None, "links[arm].joint: is missing", ""),
    ((*JOINT, "axis"), None, "links[arm].joint.axis: is missing", ""),
    (
        (*JOINT, "axis"),
        [0.0, 0.0, 0.0],
        "links[arm].joint.axis = [0.0, 0.0, 0.0]",
        "must have a direction",
    ),
    (
        (*JOINT, "axis"),
        [0.0, 1.0, math.inf],
        "links[arm].joint.axis[2] = inf",
        "must be a finite number",
    ),
    (
        (*JOINT, "kind"),
        "planar",
        "links[arm].joint.kind = 'planar'",
        "must be one of revolute, prismatic",
    ),
    (
        (*JOINT, "rpy"),
        [0.0, 0.0],
        "links[arm].joint.rpy = [0.0, 0.0]",
        "must be three numbers",
    ),
    (
        (*JOINT, "quaternion_wxyz"),
        [1.0, 0.0, 0.0, 0.0],
        "links[arm].joint.rpy",
        "not be given together",
    ),
    (
        (*JOINT, "effort_limit"),
        -0.1,
        "links[arm].joint.effort_limit = -0.1",
        "must be at least 0, N m or N",
    ),
    (
        (*JOINT, "effort_limit"),
        math.nan,
        "links[arm].joint.effort_limit = nan",
        "must be a number, N m or N",
    ),
    (
        (*JOINT, "damping"),
        -0.1,
        "links[arm].joint.damping = -0.1",
        "must be at least 0, N m s/rad or N s/m",
    ),
    (
        (*JOINT, "coulomb_rate"),
        0.0,
        "links[arm].joint.coulomb_rate = 0.0",
        "must be above 0, rad/s or m/s",
    ),
    (
        (*JOINT, "lower"),
        2.0,
        "joints[shoulder].lower = 2.0",
        "must be below upper = 1.6",
    ),
    (
        (*JOINT, "lower"),
        math.nan,
        "links[arm].joint.lower = nan",
        "must be a number, rad or m",
    ),
    (
        (*FRONT, "direction"),
        "left",
        "rotors[front].direction = 'left'",
        "must be one of ccw, cw",
    ),
    ((*FRONT, "direction"), 1, "rotors[front].direction = 1", "must be one of ccw, cw"),
    (
        (*FRONT, "axis"),
        [0.0, 0.0, 0.0],
        "rotors[front].axis = [0.0, 0.0, 0.0]",
        "must have a direction",
    ),
    (
        (*FRONT, "name"),
        "left",
        "rotors.name = 'left'",
        "stands twice; names must be unique",
    ),
    ((*FRONT, "position"), None, "rotors[front].position: is missing", ""),
    (
        ("rotor_defaults", "thrust_coefficient"),
        0.0,
        "rotor_defaults.thrust_coefficient = 0.0",
        "must be above 0, N s^2/rad^2",
    ),
    (
        ("rotor_defaults", "thrust_coefficient"),
        None,
        "rotors[front].thrust_coefficient: is missing",
        "",
    ),
    (
        ("frames", 0, "link"),
        "hand",
        "frames[tip].link = 'hand'",
        "must be one of base, arm",
    ),
    (("end_effector",), "nose", "end_effector = 'nose'", "must be tip"),
    (("drag",), {"area": [0.1, -0.1, 0.1]}, "drag.area.y = -0.1", "must be at least 0"),
    (("drag",), {"air_density": 1.0}, "drag.area: is missing", ""),
    (
        ("joints",),
        [{"name": "shoulder", "damping": 1.0}],
        "joints.name = 'shoulder'",
        "must stand in its link",
    ),
    (
        ("sources", "base.mass"),
        "",
        "sources.base.mass = ''",
        "must be text that is not empty",
    ),
    (("sources", "base.mass"), 1.0, "sources.base.mass = 1.0", "must be text"),
    (("urdf",), "nowhere.urdf", "urdf = 'nowhere.urdf'", "no such file"),
    (("loops",), [], "loops = []", "unknown field"),
]


@pytest.mark.parametrize(
    ("path", "value", "field", "allowed"), CASES, ids=[f"{c[2]}"[:60] for c in CASES]
)
def test_a_wrong_field_is_refused_with_file_field_value_and_what_is_allowed(
    tmp_path, path, value, field, allowed
):
    file = file_of(tmp_path, changed(path, value))
    text = refusal(file)
    assert text.startswith(f"{file}: {field}")
    assert allowed in text.removeprefix(f"{file}: {field}")


def test_the_example_of_these_cases_is_itself_accepted(tmp_path):
    assert load_vehicle(file_of(tmp_path, DOCUMENT)).name == "example"


@pytest.mark.parametrize(
    ("off", "accepted"),
    [(0.9e-6, True), (-0.9e-6, True), (1.1e-6, False), (-1.1e-6, False)],
)
def test_a_quaternion_may_be_off_unit_length_by_a_millionth(tmp_path, off, accepted):
    document = changed((*JOINT, "rpy"), None)
    document["links"][0]["joint"]["quaternion_wxyz"] = [
        0.0,
        0.6 * (1 + off),
        0.0,
        0.8 * (1 + off),
    ]
    file = file_of(tmp_path, document)
    if accepted:
        R = load_vehicle(file).links[0].joint.rotation
        # normalised: rows are of unit length to rounding, not to 1e-6
        assert max(abs(float(row.dot(row)) - 1.0) for row in R.rows) < 1e-15
    else:
        text = refusal(file)
        assert text.startswith(f"{file}: links[arm].joint.quaternion_wxyz = [")
        assert "must be of unit length within 1e-06; its length is " in text


def two_links(tmp_path, **second):
    document = copy.deepcopy(DOCUMENT)
    link = copy.deepcopy(document["links"][0])
    link["name"], link["joint"]["name"], link["parent"] = "hand", "wrist", "arm"
    link.update(second)
    document["links"].append(link)
    return document


def test_a_ring_of_parents_is_refused_by_its_links(tmp_path):
    document = two_links(tmp_path)
    document["links"][0]["parent"] = "hand"
    text = refusal(file_of(tmp_path, document))
    assert (
        "links[arm].parent = 'hand': closed chains are not supported (arm -> hand ->"
        " arm)" in text
    )


@pytest.mark.parametrize("table", ["links", "joints"])
def test_two_links_or_joints_of_one_name_are_refused(tmp_path, table):
    document = two_links(tmp_path)
    if table == "links":
        document["links"][1]["name"], document["links"][1]["parent"] = "arm", "base"
    else:
        document["links"][1]["joint"]["name"] = "shoulder"
    assert (
        f"{table}.name = '{'arm' if table == 'links' else 'shoulder'}': stands twice"
        in refusal(file_of(tmp_path, document))
    )


def test_two_frames_of_one_name_are_refused(tmp_path):
    document = copy.deepcopy(DOCUMENT)
    document["frames"].append(document["frames"][0])
    assert "frames.name = 'tip': stands twice" in refusal(file_of(tmp_path, document))


def test_children_may_stand_before_their_parents(tmp_path):
    document = two_links(tmp_path)
    document["links"].reverse()
    vehicle = load_vehicle(file_of(tmp_path, document))
    assert [(link.name, link.parent) for link in vehicle.links] == [
        ("arm", -1),
        ("hand", 0),
    ]


def test_an_unknown_vehicle_lists_those_there_are():
    text = refusal("hummingbird_arm3")
    assert text.startswith("vehicle = 'hummingbird_arm3': ")
    assert all(name in text for name in list_vehicles())


def test_a_missing_file_is_named(tmp_path):
    text = refusal(tmp_path / "none.toml")
    assert text.startswith(f"vehicle = {str(tmp_path / 'none.toml')!r}: no such file")


def test_a_file_of_another_kind_is_refused(tmp_path):
    path = tmp_path / "v.yaml"
    path.write_text("a: 1", encoding="utf-8")
    assert "must be one of" in refusal(path)
    assert "the path of a .toml, .urdf, .sdf or .xml (MJCF) file" in refusal(path)


def test_a_syntax_error_names_its_line(tmp_path):
    path = tmp_path / "v.toml"
    path.write_text("schema = 1\nname = \n", encoding="utf-8")
    text = refusal(path)
    assert text.startswith(f"{path}: TOML = ")
    assert "line 2" in text


def test_bytes_that_are_not_text_are_refused(tmp_path):
    path = tmp_path / "v.toml"
    path.write_bytes(b'schema = 1\nname = "\xff"\n')
    assert refusal(path) == f"{path}: byte 19 = 0xff: must be UTF-8 text"


def test_a_line_break_in_a_name_does_not_break_the_message(tmp_path):
    document = changed((*ARM, "name"), "two\\nlines")
    document["frames"][0]["link"] = "base"
    document["links"][0]["joint"]["axis"] = [0.0, 0.0, 0.0]
    assert (
        "links[two lines].joint.axis = [0.0, 0.0, 0.0]: must have a direction"
        in refusal(file_of(tmp_path, document))
    )


def test_a_folder_is_no_vehicle(tmp_path):
    folder = tmp_path / "v.toml"
    folder.mkdir()
    assert "is a folder" in refusal(folder)


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"mass": 0.0, "inertia": [0.0, 0.0, 0.0]}, "shoulder"),  # nothing at all
        # a point on the axis
        ({"com": [0.0, -0.1, 0.0], "inertia": [0.0, 0.0, 0.0]}, "shoulder"),
        # a rod along the axis
        ({"com": [0.0, 0.0, 0.0], "inertia": [1e-4, 0.0, 1e-4]}, "shoulder"),
    ],
)
def test_a_joint_that_moves_no_mass_is_refused_by_name(tmp_path, change, name):
    document = copy.deepcopy(DOCUMENT)
    document["links"][0].update(change)
    assert f"joints[{name}] = " in (text := refusal(file_of(tmp_path, document)))
    assert "must move mass outward of it" in text


def test_a_sliding_joint_without_mass_is_refused_though_it_has_inertia(tmp_path):
    document = copy.deepcopy(DOCUMENT)
    document["links"][0].update(mass=0.0)
    document["links"][0]["joint"]["kind"] = "prismatic"
    assert "joints[shoulder] = 'prismatic joint of 'arm'" in refusal(
        file_of(tmp_path, document)
    ).replace('"', "'")


def test_two_joints_about_one_axis_that_move_one_body_are_refused(tmp_path):
    document = two_links(tmp_path)
    document["links"][0].update(mass=0.0, inertia=[0.0, 0.0, 0.0])
    document["links"][1]["joint"].update(position=[0.0, 0.0, 0.0], rpy=[0.0, 0.0, 0.0])
    assert "joints[shoulder] = " in refusal(file_of(tmp_path, document))


def test_a_massless_link_between_two_different_axes_is_accepted(tmp_path):
    document = two_links(tmp_path)
    document["links"][0].update(mass=0.0, inertia=[0.0, 0.0, 0.0])
    document["links"][1]["joint"].update(
        position=[0.0, 0.0, -0.1], axis=[1.0, 0.0, 0.0]
    )
    assert load_vehicle(file_of(tmp_path, document)).n == 2


def test_a_tip_of_zero_mass_is_accepted_and_changes_nothing(tmp_path):
    document = copy.deepcopy(DOCUMENT)
    bare = load_vehicle(file_of(tmp_path, document))
    document["links"][0]["parts"] = [
        {"name": "tip", "mass": 0.0, "com": [0.0, 0.0, -0.2]}
    ]
    assert load_vehicle(file_of(tmp_path, document)).links[0].body == bare.links[0].body


def test_a_base_that_is_a_point_is_refused(tmp_path):
    document = copy.deepcopy(DOCUMENT)
    document["base"] = {"mass": 1.0}
    document["links"], document["frames"], document["end_effector"] = [], [], ""
    document["sources"] = {}
    said = (
        "base.inertia = 'principal moments 0, 0, 0': must leave no axis without inertia"
    )
    assert said in refusal(file_of(tmp_path, document))


@pytest.mark.parametrize("order", ["forward", "backward", "shuffled"])
def test_links_are_put_in_order_whatever_their_number_and_order_in_the_file(order):
    names = [f"l{i}" for i in range(3000)]
    parents = {name: "base" if i == 0 else names[i - 1] for i, name in enumerate(names)}
    items = list(parents.items())
    if order == "backward":
        items.reverse()
    elif order == "shuffled":
        random.Random(1).shuffle(items)
    assert description.tree_order(dict(items), "base", "{}") == names


def test_links_that_could_stand_in_any_order_keep_that_of_the_file():
    parents = {"d": "b", "b": "base", "c": "a", "a": "base", "e": "base"}
    # of those whose parent stands already always the first in the file
    assert description.tree_order(parents, "base", "{}") == ["b", "d", "a", "c", "e"]
