"""Names that can be added: who may take which, and what is said of one that is not
there.
"""

from __future__ import annotations

import subprocess
import sys

import pytest

import skyarm
from skyarm.records.files import must_be_one_of
from skyarm.records.registry import (
    KINDS,
    RegistryError,
    find,
    names,
    register,
    registrations,
)
from skyarm.records.registry.registrations import add, registering_for
from skyarm.records.registry.shipped import SHIPPED
from support.components import Ceiling, Tether, registry_kept


@pytest.fixture(autouse=True)
def _kept():
    with registry_kept():
        yield


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_what_is_decorated_is_found_under_its_name_and_stays_what_it_is(kind):
    class Thing:
        """A thing of a user's own.

        More about it.
        """

    assert getattr(register, kind)("mine")(Thing) is Thing
    assert find(kind, "mine") is Thing
    assert names(kind)[-1] == "mine"
    row = registrations(kind)["mine"]
    assert (row.title, row.source) == ("A thing of a user's own", "this process")
    assert "mine" not in names("law" if kind != "law" else "air")


def test_a_title_may_be_given_and_may_be_missing():
    register.air("titled", title="moving air")(Tether)
    register.air("bare")(lambda: None)
    assert [registrations("air")[name].title for name in ("titled", "bare")] == [
        "moving air",
        "",
    ]


def test_everything_that_ships_is_found_and_has_a_line():
    for kind, rows in SHIPPED.items():
        assert list(rows) == list(names(kind))[: len(rows)]
        for name in rows:
            assert find(kind, name) is not None
            assert registrations(kind)[name].source == "skyarm"


def test_the_registry_imports_nothing_until_a_name_is_used():
    program = (
        "import sys; from skyarm.records.registry import names, find; names('plant');"
        " print(any('mujoco' in m or m.startswith('skyarm.plant') for m in"
        " sys.modules)); find('plant', 'rigid_body'); print('skyarm.plant.compiled' in"
        " sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        check=True,
        timeout=60.0,
    )
    assert done.stdout.split() == ["False", "True"]


def test_a_name_that_is_taken_is_refused_with_both_sources():
    add("force", "mine", Tether, source="first.py")
    with pytest.raises(RegistryError) as caught:
        add("force", "mine", Ceiling, source="second 1.2")
    words = (
        "force 'mine': is registered by first.py and by second 1.2; rename one of them"
    )
    assert str(caught.value) == words
    assert find("force", "mine") is Tether
    with pytest.raises(
        RegistryError,
        match=r"^plant 'mujoco': is registered by skyarm and by this process;",
    ):
        register.plant("mujoco")(Ceiling)
    # the same name of another kind is another name, and the same thing again is the
    # same
    register.ending("mine")(Ceiling)
    add("force", "mine", Tether, source="first.py")


@pytest.mark.parametrize(
    ("kind", "name", "words"),
    [
        ("law", "indy", "did you mean 'indi'\\? must be one of rotors_sim_position, "),
        (
            "plant",
            "rigidbody",
            "did you mean 'rigid_body'\\? must be one of rigid_body, mujoco",
        ),
        (
            "motion",
            "zigzag",
            r"must be one of hover, circle, signals, waypoints, phases$",
        ),
        ("motion", 3, r"must be one of hover, circle, signals, waypoints, phases$"),
        ("metric", "fly", r"must be left out: there is none$"),
    ],
)
def test_a_name_that_is_not_there_is_one_line_with_what_is(kind, name, words):
    with pytest.raises(RegistryError, match=rf"^{kind} = {name!r}: {words}"):
        find(kind, name)
    with pytest.raises(RegistryError, match=r"^plant\.kind = "):
        find("plant", "nothing", "plant.kind")


def test_what_a_user_added_is_offered_too():
    register.force("near_ceiling")(Tether)
    with pytest.raises(
        RegistryError,
        match=(
            r"did you mean 'near_ceiling'\? must be one of force_wind, .*,"
            r" near_ceiling$"
        ),
    ):
        find("force", "near_ceilng")
    assert must_be_one_of({}, "x") == "must be left out: there is none"


@pytest.mark.parametrize("name", ["", "two words!", "a\nb", 3, None, "x" + chr(27)])
def test_a_name_is_letters_and_digits(name):
    with pytest.raises(RegistryError, match=r"^air: name = .*must be letters, digits"):
        register.air(name)(Tether)


def test_a_kind_that_is_none_is_said():
    with pytest.raises(
        RegistryError, match=r"^kind = 'wind': must be one of air, force, "
    ):
        add("wind", "mine", Tether)
    with pytest.raises(
        AttributeError, match=r"^register\.wind: there are air, force, "
    ):
        register.wind("mine")


def test_a_thing_whose_module_is_not_there_is_one_line():
    add("law", "broken", "skyarm.no_such_room:make", source="pack 1.0")
    add("law", "renamed", "skyarm.control.catalogue:no_such_law", source="pack 1.0")
    for name in ("broken", "renamed"):
        with pytest.raises(
            RegistryError, match=rf"^law '{name}' of pack 1\.0: cannot be loaded \("
        ):
            find("law", name)


def test_what_is_registered_by_something_that_fails_does_not_stay():
    before = {kind: dict(registrations(kind)) for kind in KINDS}

    def failing():
        with registering_for("half.py"):
            register.force("first_half")(Tether)
            assert registrations("force")["first_half"].source == "half.py"
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        failing()
    assert {kind: dict(registrations(kind)) for kind in KINDS} == before
    register.force("after")(Tether)
    assert registrations("force")["after"].source == "this process"


def test_the_front_of_the_library_has_the_door():
    assert skyarm.register is register


def test_only_the_command_line_makes_names_with_paths_in_them() -> None:
    with pytest.raises(RegistryError, match=r"name = 'a/b\.py:make'"):
        register.air("a/b.py:make")(object)
