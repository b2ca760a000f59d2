"""Shapes that cannot be are refused with one line: file, field, value, what is
allowed.
"""

import numpy as np
import pytest
from vehicle_documents import written

from skyarm import load_vehicle
from skyarm.records.files.stl_mesh import MOST
from skyarm.vehicle import VehicleError
from support.commands import refused, skyarm

CUBE = [[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)]


def vertices(rows):
    return "".join(f"v {' '.join(map(str, each))}\n" for each in rows)


FILES = {
    "cube.obj": vertices(CUBE),
    "inside_out.obj": vertices(CUBE) + "f 1 2 3\nf 3 2 1\nf 5 6 7\n",
    "point.obj": vertices([[1.0, 2.0, 3.0]] * 3),
    "flat.obj": vertices([[x, y, 1.0] for x, y, _ in CUBE]),
    "line.obj": vertices([[x, x, x] for x in range(9)]),
    "empty.obj": "# nothing\n",
    "words.obj": vertices([*CUBE, ["a", "b", "c"]]),
    "nan.obj": vertices([*CUBE, ["nan", 0, 0]]),
    "far.obj": vertices([*CUBE, [1e9, 0, 0]]),
    "many.obj": vertices(CUBE[:1]) * (MOST + 1),
    "text.stl": "hello",
    "part.dae": "<COLLADA/>",
    "part.ply": "ply",
    "no_suffix": vertices(CUBE),
}


def vehicle(folder, *shapes, meshes=""):
    """A vehicle file with some shapes, beside the files that these or a text name."""
    for name, text in FILES.items():
        if name in f"{meshes} {shapes}":
            (folder / name).write_text(text, encoding="utf-8")
    (folder / "folder.obj").mkdir()
    path = folder / "v.toml"
    tables = "".join(
        "[[collisions]]\n"
        + "".join(f"{key} = {written(value)}\n" for key, value in each.items())
        for each in shapes
    )
    path.write_text(
        'schema = 1\nname = "v"\nbase = { mass = 1.0, inertia = [0.1, 0.1, 0.1] }\n'
        + tables,
        encoding="utf-8",
    )
    return path


def ball(**words):
    return {"name": "s", "shape": "sphere", "size": [0.1], **words}


def sized(shape, *size):
    return {"name": "s", "shape": shape, "size": list(size)}


def hull(**words):
    return {"name": "s", "shape": "hull", **words}


BOX_SIZES = "collisions[s].size = "
ONE_PLANE = "has all of its vertices in one plane: must have a volume"
POSITIVE = "must be above 0"
ONE_OF_TWO = "must have either vertices or mesh"
NO_HULL = "must be 'hull' where vertices or mesh are stated"
NAN, INF = float("nan"), float("inf")

WRONG = [
    # what is wrong with the size
    (sized("sphere", 0.0), "collisions[s].size[0] = 0.0", POSITIVE),
    (sized("sphere", -1.0), "collisions[s].size[0] = -1.0", POSITIVE),
    (sized("sphere", NAN), "collisions[s].size[0] = nan", "finite number"),
    (sized("sphere", INF), "collisions[s].size[0] = inf", "finite number"),
    (sized("box", 1.0, 0.0, 1.0), "collisions[s].size[1] = 0.0", POSITIVE),
    (sized("box", 1.0, 1.0, -1e-9), "collisions[s].size[2] = -1e-09", POSITIVE),
    (sized("capsule", 0.1, 0.0), "collisions[s].size[1] = 0.0", POSITIVE),
    (sized("cylinder", 0.1, -2.0), "collisions[s].size[1] = -2.0", POSITIVE),
    (sized("sphere"), f"{BOX_SIZES}[]", "must be one number, radius"),
    (sized("sphere", 1.0, 1.0), f"{BOX_SIZES}[1.0, 1.0]", "must be one number, radius"),
    (sized("capsule", 1.0), f"{BOX_SIZES}[1.0]", "must be 2 numbers, radius, length"),
    (sized("cylinder", 1.0), f"{BOX_SIZES}[1.0]", "must be 2 numbers, radius, length"),
    (sized("box", 1.0), f"{BOX_SIZES}[1.0]", "must be 3 numbers, x, y, z"),
    (sized("box", *[1.0] * 4), BOX_SIZES, "must be 3 numbers, x, y, z"),
    ({"name": "s", "shape": "box"}, "collisions[s].size: is missing", ""),
    (ball(size="big"), "collisions[s].size = 'big'", "must be a list of numbers"),
    (ball(size=[True]), "collisions[s].size[0] = True", "must be a finite number"),
    (ball(size=["1"]), "collisions[s].size[0] = '1'", "must be a finite number"),
    (ball(size=0.1), "collisions[s].size = 0.1", "must be a list of numbers"),
    # the shape, the name, the place
    (sized("ball", 1.0), "shape = 'ball'", "must be one of sphere, capsule, box"),
    (sized("plane"), "shape = 'plane'", "must be one of sphere, capsule, box"),
    ({"name": "s", "size": [1.0]}, "collisions[s].shape: is missing", "there are"),
    ({"shape": "sphere", "size": [1.0]}, "collisions[0].name: is missing", ""),
    (ball(name=""), "collisions[0].name = ''", "must be text that is not empty"),
    (ball(link="arm"), "collisions[s].link = 'arm'", "must be one of base"),
    (ball(position=[0.0]), "collisions[s].position", "must be three numbers"),
    (ball(position=[0.0, 0.0, NAN]), "collisions[s].position[2] = nan", "finite"),
    (
        ball(rpy=[0.0, 90.0, 0.0]),
        "collisions[s].rpy",
        "within a turn: rad, not degrees",
    ),
    (ball(quaternion_wxyz=[1.0, 1.0, 0.0, 0.0]), "quaternion_wxyz", "of unit length"),
    (ball(colour="red"), "collisions[s].colour = 'red'", "unknown field; allowed"),
    (ball(radius=0.1), "collisions[s].radius = 0.1", "unknown field; allowed"),
    (ball(most_vertices=8), "s].most_vertices = 8", "must be left out without mesh"),
    # hulls of corners
    (hull(), "shape = 'hull'", ONE_OF_TWO),
    (hull(vertices=[]), "shape = 'hull'", ONE_OF_TWO),
    (hull(vertices=CUBE[:3]), "collisions[s].vertices = 3", "must be 4 to 256 points"),
    (hull(vertices=CUBE[:4]), "collisions[s].vertices: ", ONE_PLANE),
    (hull(vertices=CUBE[:1] * 5), "collisions[s].vertices: ", ONE_PLANE),
    (hull(vertices=CUBE * 33), "collisions[s].vertices = 264", "must be 4 to 256"),
    (hull(vertices=5), "collisions[s].vertices = 5", "must be 4 to 256 points"),
    (hull(vertices="cube"), "collisions[s].vertices = 'cube'", "must be 4 to 256"),
    (hull(vertices=["a"] * 4), "collisions[s].vertices[0]", "must be three numbers"),
    (
        hull(vertices=[[0.0, 1.0]] * 4),
        "collisions[s].vertices[0]",
        "must be three numbers",
    ),
    (hull(vertices=[[NAN] * 3] * 4), "collisions[s].vertices[0][0] = nan", "finite"),
    (hull(vertices=[[INF] * 3] * 4), "collisions[s].vertices[0][0] = inf", "finite"),
    (
        hull(vertices=[*CUBE, [0, 0, 1e200]]),
        "vertices: has a vertex at",
        "within 1000 m",
    ),
    (hull(vertices=[["a"] * 3] * 4), "collisions[s].vertices[0]", "must be a"),
    (hull(vertices=CUBE, size=[1.0]), "size = [1.0]", "unknown field"),
    (ball(vertices=CUBE), "shape = 'sphere'", NO_HULL),
    # hulls of meshes
    (hull(mesh="cube.obj", vertices=CUBE), "shape = 'hull'", ONE_OF_TWO),
    (ball(mesh="cube.obj"), "shape = 'sphere'", NO_HULL),
    (hull(mesh=""), "shape = 'hull'", ONE_OF_TWO),
    (hull(mesh=5), "collisions[s].mesh = 5", "must be text"),
    (hull(mesh="absent.obj"), "mesh = 'absent.obj'", "no such file"),
    (hull(mesh="../cube.obj"), "mesh = '../cube.obj'", "no such file"),
    (hull(mesh="/no/part.stl"), "mesh = '/no/part.stl'", "no such file"),
    (hull(mesh="folder.obj"), "mesh = 'folder.obj'", "is a folder"),
    (hull(mesh="/etc/passwd"), "mesh = '/etc/passwd'", "must end in .stl or .obj"),
    (hull(mesh="part.dae"), "mesh = 'part.dae'", "a mesh tool converts it"),
    (hull(mesh="part.ply"), "mesh = 'part.ply'", "must end in .stl or .obj"),
    (hull(mesh="no_suffix"), "mesh = 'no_suffix'", "must end in .stl or .obj"),
    (hull(mesh="point.obj"), "mesh = 'point.obj'", ONE_PLANE),
    (hull(mesh="flat.obj"), "mesh = 'flat.obj'", ONE_PLANE),
    (hull(mesh="line.obj"), "mesh = 'line.obj'", ONE_PLANE),
    (hull(mesh="empty.obj"), "mesh = 'empty.obj'", "has 0 vertices, must have from 1"),
    (hull(mesh="many.obj"), "mesh = 'many.obj'", f"has {MOST + 1} vertices"),
    (
        hull(mesh="words.obj"),
        "mesh = 'words.obj'",
        "three numbers in each line v x y z",
    ),
    (hull(mesh="nan.obj"), "mesh = 'nan.obj'", "within 1000 m of the origin"),
    (hull(mesh="far.obj"), "mesh = 'far.obj'", "within 1000 m of the origin"),
    (hull(mesh="text.stl"), "mesh = 'text.stl'", "must be an STL file"),
    (hull(mesh="cube.obj", scale=[0.0, 1.0, 1.0]), "mesh = 'cube.obj'", ONE_PLANE),
    (hull(mesh="cube.obj", scale=0.1), "scale = 0.1", "must be three numbers"),
    (hull(mesh="cube.obj", scale=[1e9] * 3), "mesh = 'cube.obj'", "within 1000 m"),
    (hull(mesh="cube.obj", most_vertices=3), "most_vertices = 3", "at least 4"),
    (hull(mesh="cube.obj", most_vertices=257), "most_vertices = 257", "at most 256"),
    (hull(mesh="cube.obj", most_vertices="8"), "most_vertices = '8'", "finite number"),
    (hull(vertices=CUBE, scale=[1.0] * 3), "scale = [1.0", "left out without mesh"),
    (hull(vertices=CUBE, most_vertices=8), "most_vertices = 8", "without mesh"),
]


@pytest.mark.parametrize(("shape", "field", "allowed"), WRONG)
def test_a_wrong_shape_is_refused_with_one_line(tmp_path, shape, field, allowed):
    path = vehicle(tmp_path, shape)
    with pytest.raises(VehicleError) as error:
        load_vehicle(path)
    text = str(error.value)
    assert "\n" not in text
    assert text.startswith(f"{path}: ")
    assert field in text
    assert allowed in text


def test_wrong_lists_of_shapes_are_refused(tmp_path):
    with pytest.raises(VehicleError, match=r"collisions.name = 's': stands twice"):
        load_vehicle(vehicle(tmp_path, ball(), ball()))
    path = tmp_path / "v.toml"
    text = path.read_text().partition("[[")[0]
    path.write_text(f"{text}collisions = 5\n")
    with pytest.raises(VehicleError, match=r"collisions = 5: must be a list of tables"):
        load_vehicle(path)
    path.write_text(f'{text}import_collisions = "all"\n')
    allowed = r"import_collisions = 'all': must be .*none, file.*capsules"
    with pytest.raises(VehicleError, match=allowed):
        load_vehicle(path)


def test_right_shapes_beside_the_wrong_ones_are_taken(tmp_path):
    cube = hull(mesh="cube.obj")
    turned = {**hull(mesh="inside_out.obj", scale=[-1.0, 2.0, 1.0]), "name": "t"}
    read = load_vehicle(vehicle(tmp_path, cube, turned, ball(name="b")))
    assert [each.shape for each in read.collisions] == ["hull", "hull", "sphere"]
    corners = np.array([list(map(float, v)) for v in read.collisions[1].vertices])
    assert sorted(corners.tolist()) == sorted([[-x, 2 * y, z] for x, y, z in CUBE])
    assert read.notes == ()


def test_a_wrong_shape_ends_a_command_with_code_2(tmp_path):
    path = vehicle(tmp_path, sized("sphere", -1.0))
    said = "v.toml: collisions[s].size[0] = -1.0: must be above 0"
    refused(skyarm("check", str(path)), said)


def link(shape, place=""):
    return (
        '<robot name="r"><link name="b"><inertial><mass value="1"/><inertia ixx="1"'
        ' iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial><collision>'
        f"{place}<geometry>{shape}</geometry></collision></link></robot>"
    )


@pytest.mark.parametrize(
    ("shape", "said"),
    [
        ('<sphere radius="0"/>', "must be above 0"),
        ('<sphere radius="-1"/>', "must be above 0"),
        ('<sphere radius="nan"/>', "radius = 'nan': must be a finite number"),
        ("<sphere/>", "radius = '': must be a finite number"),
        ('<box size="1 1"/>', "size = '1 1': must be three numbers"),
        ('<box size="1 1 0"/>', "must be above 0"),
        ('<cylinder radius="1"/>', "length = '': must be a finite number"),
        ('<mesh filename="flat.obj"/>', ONE_PLANE),
        ('<mesh filename="point.obj"/>', ONE_PLANE),
        ('<mesh filename="many.obj"/>', f"has {MOST + 1} vertices"),
        ('<mesh filename="cube.obj" scale="1"/>', "scale = '1': must be three numbers"),
    ],
)
def test_a_wrong_shape_of_another_file_is_refused_if_asked_for(tmp_path, shape, said):
    (tmp_path / "r.urdf").write_text(link(shape))
    path = vehicle(tmp_path, meshes=shape)
    path.write_text('schema = 1\nname = "v"\nurdf = "r.urdf"\n')
    assert load_vehicle(path).collisions == ()
    path.write_text(f'{path.read_text()}import_collisions = "file"\n')
    with pytest.raises(VehicleError) as error:
        load_vehicle(path)
    text = str(error.value)
    assert "\n" not in text
    assert text.startswith(f"{path}: link[b].collision: ")
    assert said in text
