"""Shapes that touch, from URDF, SDF and MJCF files: where MuJoCo and SciPy see them."""

import re
import tomllib

import mujoco
import numpy as np
import pytest
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from skyarm import load_vehicle
from skyarm.dynamics.kinematics import frame_pose
from skyarm.vehicle.imported_shapes import capsule_around
from skyarm.vehicle.own_file import own_vehicle_file
from skyarm.vehicle.vehicle_files import load_with_bodies

GEOMS = {
    "sphere": lambda draw: draw.uniform(0.01, 0.1, 1),
    "capsule": lambda draw: draw.uniform(0.01, 0.1, 2),
    "cylinder": lambda draw: draw.uniform(0.01, 0.1, 2),
    "box": lambda draw: draw.uniform(0.01, 0.1, 3),
}


def words(values):
    return " ".join(repr(float(each)) for each in values)


def octahedron(draw):
    """Corners of an octahedron with a point inside, shape (7, 3)."""
    return np.concatenate([np.eye(3), -np.eye(3), [[0.1, 0.1, 0.1]]]) * draw.uniform(
        0.05, 0.2, 3
    )


FACES = ("1 2 3", "2 4 3", "4 5 3", "5 1 3", "2 1 6", "4 2 6", "5 4 6", "1 5 6")


def obj(folder, name, corners):
    (folder / name).write_text(
        "# a comment\n"
        + "".join(f"v {words(each)}\n" for each in corners)
        + "".join(f"f {each}\n" for each in FACES)
    )
    return name


def placed(draw):
    quaternion = Rotation.random(random_state=draw).as_quat(scalar_first=True)
    return f'pos="{words(draw.normal(size=3))}" quat="{words(quaternion)}"'


def mjcf(folder, seed):
    """A free base and three links, each with geoms of all kinds."""
    draw = np.random.default_rng(seed)
    obj(folder, "part.obj", octahedron(draw))
    text = ""
    for k in range(4):
        geoms = "".join(
            f'<geom type="{kind}" size="{words(size(draw))}" {placed(draw)} group="3"/>'
            for kind, size in GEOMS.items()
        )
        geoms += f'<geom type="mesh" mesh="part" {placed(draw)}/>'
        geoms += (
            f'<geom type="capsule" size=".02" fromto="{words(draw.normal(size=6))}"/>'
        )
        geoms += '<geom type="box" size="1 1 1" contype="0" conaffinity="0"/>'
        joint = (
            f'<joint type="{draw.choice(["hinge", "slide"])}" name="j{k}"'
            f' axis="{words(draw.normal(size=3))}" pos="{words(draw.normal(size=3))}"/>'
            if k
            else "<freejoint/>"
        )
        text += (
            f'<body name="b{k}" {placed(draw) if k else ""}>{joint}{geoms}'
            '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
        )
    path = folder / "v.xml"
    path.write_text(
        '<mujoco><asset><mesh name="part" file="part.obj"/></asset><worldbody>'
        f'<geom type="plane" size="1 1 1"/>{text}{"</body>" * 4}</worldbody></mujoco>'
    )
    return path


def ours(vehicle, joints):
    """Name of shape, size, rotation, position in the base and hull in it, by shape."""
    rows = []
    for each in vehicle.collisions:
        pose = frame_pose(vehicle, each, joints)
        R = np.array([[float(x) for x in row] for row in pose.R.rows])
        p = np.array([float(x) for x in pose.p])
        corners = np.array([[float(x) for x in v] for v in each.vertices])
        rows.append((each.shape, each.size, R, p, corners.reshape(-1, 3) @ R.T + p))
    return rows


def of_mujoco(model, data, geoms):
    """The same rows from a MuJoCo model."""
    rows = []
    kinds = {2: "sphere", 3: "capsule", 5: "cylinder", 6: "box", 7: "hull"}
    for geom in geoms:
        kind = kinds[model.geom_type[geom]]
        a, b, c = model.geom_size[geom]
        size = {
            "sphere": (a,),
            "capsule": (a, 2 * b),
            "cylinder": (a, 2 * b),
            "box": (2 * a, 2 * b, 2 * c),
            "hull": (),
        }[kind]
        R, p = data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom]
        corners = np.zeros((0, 3))
        if kind == "hull":
            mesh = model.geom_dataid[geom]
            first = model.mesh_vertadr[mesh]
            corners = model.mesh_vert[first : first + model.mesh_vertnum[mesh]]
        rows.append((kind, size, R, p, corners @ R.T + p))
    return rows


def require_equal(mine, theirs):
    assert len(mine) == len(theirs) > 0
    for a, b in zip(mine, theirs, strict=True):
        assert a[0] == b[0]
        assert a[1] == pytest.approx(b[1], abs=1e-12)
        if a[0] == "hull":  # the axes of a mesh are free, and its numbers float32
            assert len(a[4]) == 6
            assert ConvexHull(a[4]).volume == pytest.approx(
                ConvexHull(b[4]).volume, 1e-5
            )
            gaps = np.linalg.norm(a[4][:, None] - b[4], axis=2).min(axis=1)
            assert gaps.max() < 1e-6
        else:
            np.testing.assert_allclose(a[3], b[3], atol=1e-9)
            np.testing.assert_allclose(a[2], b[2], atol=1e-9)


@pytest.mark.parametrize("seed", range(6))
def test_geoms_are_where_mujoco_has_them(tmp_path, seed):
    path = mjcf(tmp_path, seed)
    vehicle, _ = load_with_bodies(path, "file")
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    joints = np.random.default_rng(seed).uniform(-2.0, 2.0, 3)
    data.qpos[7:] = joints
    mujoco.mj_kinematics(model, data)
    touching = [g for g in range(1, model.ngeom) if model.geom_contype[g]]
    assert len(touching) == 4 * 6
    require_equal(ours(vehicle, joints.tolist()), of_mujoco(model, data, touching))
    assert [each.name for each in vehicle.collisions][5:7] == ["b0.6", "b1.7"]


INERTIAL = (
    '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0"'
    ' iyz="0"/></inertial>'
)


def origin(draw):
    return (
        f'<origin xyz="{words(draw.normal(size=3))}"'
        f' rpy="{words(draw.uniform(-3, 3, 3))}"/>'
    )


def urdf(folder, seed, mesh="part.obj", more=""):
    """Three links in a row and one that a fixed joint carries."""
    draw = np.random.default_rng(seed)
    obj(folder, "part.obj", octahedron(draw))
    text = more
    for k in range(4):
        a, b, *c = draw.uniform(0.01, 0.1, 5).tolist()
        shapes = (
            f'<sphere radius="{a!r}"/>',
            f'<cylinder radius="{a!r}" length="{b!r}"/>',
            f'<box size="{words(c)}"/>',
            f'<mesh filename="{mesh}" scale="0.5 2 1"/>',
        )
        text += f'<link name="l{k}">{INERTIAL}' + "".join(
            f"<collision>{origin(draw)}<geometry>{each}</geometry></collision>"
            for each in shapes
        )
        text += "</link>"
    for k, kind in enumerate(("revolute", "fixed", "prismatic")):
        text += (
            f'<joint name="j{k}" type="{kind}"><parent link="l{k}"/>'
            f'<child link="l{k + 1}"/>{origin(draw)}'
            f'<axis xyz="{words(draw.normal(size=3))}"/>'
            '<limit lower="-2" upper="2" effort="1" velocity="1"/></joint>'
        )
    path = folder / "v.urdf"
    path.write_text(f'<robot name="v">{text}</robot>')
    return path


@pytest.mark.parametrize("seed", range(4))
def test_urdf_shapes_are_where_mujoco_has_them(tmp_path, seed):
    path = urdf(tmp_path, seed)
    vehicle, _ = load_with_bodies(path, "file")
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    joints = np.random.default_rng(seed).uniform(-2.0, 2.0, 2)
    data.qpos[:] = joints
    mujoco.mj_kinematics(model, data)

    def key(row):  # MuJoCo keeps the order within a body only
        return row[0], *np.round(row[4].mean(axis=0) if len(row[4]) else row[3], 4)

    mine = sorted(ours(vehicle, joints.tolist()), key=key)
    theirs = of_mujoco(model, data, range(model.ngeom))
    for row in theirs:
        assert row[0] != "hull" or len(row[4]) in (6, 7)
    # the mean of MuJoCo's vertices has the inner point, too
    theirs = [
        (*row[:4], row[4][ConvexHull(row[4]).vertices] if len(row[4]) else row[4])
        for row in theirs
    ]
    require_equal(mine, sorted(theirs, key=key))


SHAPES = {
    "box": "<size>0.1 0.2 0.3</size>",
    "cylinder": "<radius>0.05</radius><length>0.4</length>",
    "sphere": "<radius>0.05</radius>",
    "capsule": "<radius>0.05</radius><length>0.4</length>",
}


def sdf(folder, shapes, pose="1 2 3 0.1 0.2 0.3"):
    inner = "".join(
        f'<collision name="c{k}"><pose>{pose}</pose><geometry>{each}</geometry>'
        "</collision>"
        for k, each in enumerate(shapes)
    )
    path = folder / "v.sdf"
    path.write_text(
        '<sdf version="1.9"><model name="v"><link name="base"><inertial><mass>1</mass>'
        f"</inertial>{inner}</link></model></sdf>"
    )
    return path


def test_sdf_shapes_are_those_of_an_equal_urdf_file(tmp_path):
    obj(tmp_path, "part.obj", octahedron(np.random.default_rng(1)))
    shapes = [f"<{kind}>{inner}</{kind}>" for kind, inner in SHAPES.items()]
    shapes.append("<mesh><uri>part.obj</uri><scale>2 1 1</scale></mesh>")
    made, _ = load_with_bodies(sdf(tmp_path, shapes), "file")
    alike = {
        "box": 'size="0.1 0.2 0.3"',
        "cylinder": 'radius="0.05" length="0.4"',
        "sphere": 'radius="0.05"',
        "capsule": 'radius="0.05" length="0.4"',
        "mesh": 'filename="part.obj" scale="2 1 1"',
    }
    collisions = "".join(
        f'<collision><origin xyz="1 2 3" rpy="0.1 0.2 0.3"/><geometry><{kind} {inner}/>'
        "</geometry></collision>"
        for kind, inner in alike.items()
    )
    path = tmp_path / "v.urdf"
    path.write_text(
        f'<robot name="v"><link name="base">{INERTIAL}{collisions}</link></robot>'
    )
    assert made.collisions == load_with_bodies(path, "file")[0].collisions
    assert len(made.collisions) == 5


def test_a_mesh_of_an_included_model_lies_beside_its_own_file(tmp_path):
    for name in ("top", "hand"):
        (tmp_path / name).mkdir()
    path = sdf(tmp_path / "hand", ["<mesh><uri>part.obj</uri></mesh>"])
    obj(tmp_path / "hand", "part.obj", octahedron(np.random.default_rng(1)))
    path.rename(tmp_path / "hand" / "hand.sdf")
    top = tmp_path / "top" / "top.sdf"
    include = "<include><uri>model://hand</uri></include>"
    top.write_text(f'<sdf version="1.9"><model name="t">{include}</model></sdf>')
    assert len(load_with_bodies(top, "file")[0].collisions[0].vertices) == 6
    text = path.with_name("hand.sdf").read_text()
    where = text.replace("part.obj", "model://hand/part.obj")
    path.with_name("hand.sdf").write_text(where)
    assert len(load_with_bodies(top, "file")[0].collisions[0].vertices) == 6


def test_shapes_of_an_arm_go_with_it_and_those_of_its_world_stay(tmp_path):
    """Geoms of the world are its floor and walls, also where the world is the root."""
    (tmp_path / "arm.xml").write_text(
        '<mujoco><worldbody><geom type="box" size="1 1 1"/><body name="upper"'
        ' pos="0 0 1"><joint name="j" axis="0 1 0"/><geom size="0.1" pos="0.5 0 0"'
        ' mass="1"/></body></worldbody></mujoco>'
    )
    text = (
        'schema = 1\nname = "v"\nimport_collisions = "file"\n'
        "base = { mass = 1.0, inertia = [0.1, 0.1, 0.1] }\n"
        '[[attach]]\narm = "arm.xml"\nprefix = "left_"\nposition = [0.0, 2.0, 0.0]\n'
    )
    (tmp_path / "v.toml").write_text(text)
    vehicle = load_vehicle(tmp_path / "v.toml")
    assert [each.name for each in vehicle.collisions] == ["left_upper.1"]
    ((_, size, _, p, _),) = ours(vehicle, [np.pi / 2])
    assert size == (0.1,)
    np.testing.assert_allclose(p, [0.0, 2.0, 0.5], atol=1e-12)
    # and through a vehicle file that this one names, which states what touches
    again = text.partition("base")[0].replace("file", "none") + 'airframe = "v.toml"\n'
    (tmp_path / "w.toml").write_text(again)
    assert load_vehicle(tmp_path / "w.toml").collisions == vehicle.collisions


def test_a_shape_moves_with_the_link_that_a_held_joint_fixes(tmp_path):
    path = urdf(tmp_path, 3)
    free, _ = load_with_bodies(path, "file")
    (tmp_path / "v.toml").write_text(
        f'schema = 1\nname = "v"\nurdf = "{path.name}"\nimport_collisions = "file"\n'
        '[[joints]]\nname = "j0"\nhold = 0.7\n'
    )
    held = load_vehicle(tmp_path / "v.toml")
    assert held.joint_names == ("j2",)
    for a, b in zip(ours(free, [0.7, 0.3]), ours(held, [0.3]), strict=True):
        assert a[:2] == b[:2]
        for k in (2, 3, 4):
            np.testing.assert_allclose(a[k], b[k], atol=1e-12)


def test_shapes_touch_nothing_unless_the_vehicle_file_takes_them(tmp_path):
    path = urdf(tmp_path, 1)
    alone = load_vehicle(path)
    assert alone.collisions == ()
    note = "16 shapes of its file touch nothing; import_collisions = 'file' takes them"
    assert note in alone.notes
    (tmp_path / "v.toml").write_text('schema = 1\nname = "v"\nurdf = "v.urdf"\n')
    assert load_vehicle(tmp_path / "v.toml").collisions == ()
    # a shape that cannot be is no fault of a file whose shapes nobody asked for
    path.write_text(path.read_text().replace('radius="', 'radius="-'))
    assert load_vehicle(path).notes == alone.notes


def test_what_is_not_used_stands_in_a_note(tmp_path):
    path = sdf(
        tmp_path,
        [
            "<plane><normal>0 0 1</normal></plane>",
            "<ellipsoid><radii>1 2 3</radii></ellipsoid>",
            "<mesh><uri>part.dae</uri></mesh>",
            "<sphere><radius>0.1</radius></sphere>",
        ],
    )
    (tmp_path / "part.dae").write_text("<COLLADA/>")
    vehicle, _ = load_with_bodies(path, "file")
    assert [each.shape for each in vehicle.collisions] == ["sphere"]
    for word in ("plane", "ellipsoid", r"mesh> .*part\.dae"):
        (note,) = [n for n in vehicle.notes if re.search(f"<{word}", n)]
        assert "left out: must be sphere, capsule, box, cylinder or a mesh of" in note
    text = path.read_text().replace("<pose>", '<pose relative_to="x">')
    path.write_text(text)
    vehicle, _ = load_with_bodies(path, "file")
    assert vehicle.collisions == ()
    other = tmp_path / "v.xml"
    other.write_text(
        '<mujoco><worldbody><body name="b"><freejoint/><inertial pos="0 0 0" mass="1"'
        ' diaginertia="1 1 1"/><geom type="ellipsoid" size="1 2 3"/></body></worldbody>'
        "</mujoco>"
    )
    vehicle, _ = load_with_bodies(other, "file")
    assert "link b: its ellipsoid left out: no shape that touches" in vehicle.notes


def test_an_import_without_another_file_is_noted(tmp_path):
    path = tmp_path / "v.toml"
    path.write_text(
        'schema = 1\nname = "v"\nairframe = "hummingbird"\nimport_collisions = "file"\n'
    )
    (note,) = load_vehicle(path).notes
    assert note.startswith("import_collisions = 'file' takes none: no other file")


def test_an_absent_mesh_of_mjcf_is_refused_with_its_cure(tmp_path):
    path = tmp_path / "v.xml"
    path.write_text(
        '<mujoco><asset><mesh name="m" file="absent.stl"/></asset><worldbody><body>'
        '<freejoint/><geom type="mesh" mesh="m"/></body></worldbody></mujoco>'
    )
    words = r"absent\.stl.*must be a model that MuJoCo loads, with the files that"
    with pytest.raises(ValueError, match=words):
        load_vehicle(path)


def test_an_absent_mesh_is_refused_with_its_element_path_and_cure(tmp_path):
    absent = sdf(tmp_path, ["<mesh><uri>absent.stl</uri></mesh>"])
    # SDF names meshes from the folder of the file that states them
    cases = [("base", absent, str(tmp_path / "absent.stl"))]
    cases.append(("l0", urdf(tmp_path, 1, mesh="absent.stl"), "absent.stl"))
    for link, path, name in cases:
        assert load_vehicle(path).collisions == ()
        for how in ("file", "capsules"):
            with pytest.raises(ValueError, match="mesh") as refused:
                load_with_bodies(path, how)
            assert str(refused.value) == (
                f"{path}: link[{link}].collision.mesh = {name!r}: must be a file that"
                " is there; put it there, or take import_collisions = 'none' or"
                " [[collisions]]"
            )


def test_a_hull_of_few_corners_says_how_far_inside_its_mesh_it_lies(tmp_path):
    draw = np.random.default_rng(3)
    points = draw.normal(size=(300, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    urdf(tmp_path, 1)
    obj(tmp_path, "part.obj", points)
    vehicle, _ = load_with_bodies(tmp_path / "v.urdf", "file")
    hulls = [each for each in vehicle.collisions if each.shape == "hull"]
    assert {len(each.vertices) for each in hulls} == {32}
    corners = np.array([[float(x) for x in v] for v in hulls[0].vertices])
    stretched = points * [0.5, 2.0, 1.0]
    few = ConvexHull(corners)
    deepest = (stretched @ few.equations[:, :3].T + few.equations[:, 3]).max()
    assert any(
        f"hull of 32 corners, up to {1e3 * deepest:.2g} mm inside" in each
        for each in vehicle.notes
    )


def test_the_shapes_of_a_rotors_link_are_left_out(tmp_path):
    plugin = (
        '<gazebo><plugin filename="gz-sim-multicopter-motor-model-system"><jointName>'
        "r</jointName><linkName>prop</linkName><motorConstant>1e-5</motorConstant>"
        "<momentConstant>0.016</momentConstant><turningDirection>cw</turningDirection>"
        "<maxRotVelocity>800</maxRotVelocity><timeConstantUp>0.01</timeConstantUp>"
        "<timeConstantDown>0.02</timeConstantDown></plugin></gazebo>"
    )
    shape = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
    path = tmp_path / "v.urdf"
    path.write_text(
        f'<robot name="v"><link name="base">{INERTIAL}{shape}</link><link name="prop">'
        f'{INERTIAL}{shape}</link><joint name="r" type="continuous"><parent link="base"'
        f'/><child link="prop"/><axis xyz="0 0 1"/></joint>{plugin}</robot>'
    )
    vehicle, _ = load_with_bodies(path, "file")
    assert len(vehicle.rotors) == 1
    assert [each.name for each in vehicle.collisions] == ["base.1"]
    assert "link prop: shapes left out: its rotor's disc is there" in vehicle.notes


def distances(points, capsule):
    """Distance of points from a capsule's surface, positive outside."""
    R = np.array([[float(x) for x in row] for row in capsule.rotation.rows])
    local = (points - [float(x) for x in capsule.position]) @ R
    radius, half = float(capsule.size[0]), 0.5 * float(capsule.size[1])
    local[:, 2] -= np.clip(local[:, 2], -half, half)
    return np.linalg.norm(local, axis=1) - radius


@pytest.mark.parametrize("seed", range(5))
def test_a_capsule_holds_its_balls_and_touches_some(seed):
    draw = np.random.default_rng(seed)
    centres = draw.normal(size=(30, 3)) * [1.0, 0.2, 0.1]
    radii = draw.uniform(0.0, 0.2, 30)
    made = capsule_around(np.column_stack([centres, radii]), "c", 0)
    over = distances(centres, made) + radii
    assert over.max() == pytest.approx(0.0, abs=1e-7)
    # turned and moved, it has the same size
    turn = Rotation.random(random_state=seed).as_matrix()
    again = capsule_around(np.column_stack([centres @ turn.T + 1.0, radii]), "c", 0)
    # the root near zero loses half of the digits
    assert again.size == pytest.approx(made.size, rel=1e-7)


def test_one_capsule_or_ball_is_found_again():
    ends = [[1.0, 0.0, 0.0, 0.1], [1.0, 0.0, 0.5, 0.1]]
    made = capsule_around(np.array(ends), "c", 0)
    assert (made.shape, made.size) == ("capsule", pytest.approx((0.1, 0.5)))
    made = capsule_around(np.array(ends[:1]), "c", 0)
    assert (made.shape, made.size) == ("capsule", (0.1, 1e-6))


@pytest.mark.parametrize("seed", range(3))
def test_one_capsule_replaces_the_shapes_of_each_link_alone(tmp_path, seed):
    path = mjcf(tmp_path, seed)
    whole, _ = load_with_bodies(path, "file")
    few, _ = load_with_bodies(path, "capsules")
    of_base = [each for each in whole.collisions if each.link < 0]
    assert few.collisions[: len(of_base)] == tuple(of_base)
    fitted = few.collisions[len(of_base) :]
    assert [each.name for each in fitted] == ["b1", "b2", "b3"]
    nothing = [0.0, 0.0, 0.0]
    for capsule in fitted:
        for each in whole.collisions:
            if each.link != capsule.link:
                continue
            R = np.array([[float(x) for x in row] for row in each.rotation.rows])
            p = [float(x) for x in each.position]
            size = [*map(float, each.size), *nothing]
            corners = np.array([[float(x) for x in v] for v in each.vertices])
            if each.shape == "box":
                signs = np.array(np.meshgrid(*[[-0.5, 0.5]] * 3)).reshape(3, -1).T
                corners = signs * size[:3]
            elif each.shape != "hull":
                turns = np.arange(24) * np.pi / 12
                rim = size[0] * np.column_stack([np.cos(turns), np.sin(turns)])
                corners = np.concatenate(
                    [
                        np.column_stack([rim, np.full(24, s * size[1])])
                        for s in (-0.5, 0.5)
                    ]
                )
                if each.shape != "cylinder":
                    tops = [[0.0, 0.0, s * (0.5 * size[1] + size[0])] for s in (-1, 1)]
                    corners = np.concatenate([corners, tops])
            assert distances(corners @ R.T + p, capsule).max() < 1e-7


@pytest.mark.parametrize("how", ["none", "file", "capsules"])
def test_a_new_vehicle_file_has_the_shapes_that_are_asked_for(tmp_path, how):
    path = urdf(tmp_path, 2)
    text, _ = own_vehicle_file(str(path), "mine", collisions=how)
    assert (
        len(tomllib.loads(text).get("collisions", ()))
        == {
            "none": 0,
            "file": 16,
            # l0 and, carried by l1, l2 make up the others
            "capsules": 4 + 2,
        }[how]
    )
    (tmp_path / "mine.toml").write_text(text)
    asked, made = load_with_bodies(path, how)[0], load_vehicle(tmp_path / "mine.toml")
    assert len(made.collisions) == len(asked.collisions)
    for a, b in zip(made.collisions, asked.collisions, strict=True):
        assert (a.name, a.shape, a.size, a.link) == (b.name, b.shape, b.size, b.link)
        assert a.vertices == b.vertices
        for one, other in zip(a.rotation.rows, b.rotation.rows, strict=True):
            assert [*map(float, one)] == pytest.approx([*map(float, other)], abs=1e-12)
