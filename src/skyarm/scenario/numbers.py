"""Read and replace parameters of a scenario by dotted path, such as
``plant.vehicle.base.mass``.

A path starts with a word of the scenario file below which numbers vary, such as
``plant`` or ``environment.air`` (all: :func:`skyarm.scenario.paths.variable_words`),
and goes on through the words of the file (``reference.base.radius``,
``plant.joints.damping``, ``environment.wind.force.0``) or the fields of the records:
``plant.vehicle.base.mass``, ``plant.vehicle.links.forearm.joint.damping``,
``controller.gains.position.x``, ``reference.z.value``. Items of a tuple are named by
their number or, where they have one, by their name.

Some numbers are not a field of any record:

* ``plant.payload.mass``, ``model.payload.mass``: a point mass (kg) at the tip, or at
  another frame as ``plant.payload.FRAME.mass``, on top of what the vehicle carries;
* ``initial.*`` of a scenario without an initial state: the number replaced in the hover
  trim of the episode's own vehicle;
* ``initial.roll``, ``.pitch``, ``.yaw``: ZYX angles (rad) in place of the quaternion,
  whose components are scaled to unit length together once one of them is replaced.

What a scenario states of its initial state stays as it is, whatever else changes; the
rest is hover trim. A *sequence* of the file is the sum of its first value and its
ramps, and varies as those: ``reference.joints.0.1.height``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from skyarm.algebra import Quaternion, Scalar
from skyarm.algebra.scalars import data, divide
from skyarm.control.actuator_layer import with_consequences
from skyarm.dynamics import State
from skyarm.records import coerce
from skyarm.records.field_rules import accept_scalar
from skyarm.records.files import errors_as, shown
from skyarm.records.leaves import Place, Record, field_names, part, replace_at
from skyarm.records.path_names import Viewed, agent_of, word_of
from skyarm.records.units import OF_SIGNAL, Unit, units
from skyarm.scenario.paths import (
    Target,
    alone,
    by_agent,
    errors_of_agent,
    places_of,
    target_of,
)
from skyarm.scenario.scenario_checks import check_scenario
from skyarm.scenario.scenario_record import (
    PartialState,
    Scenario,
    ScenarioError,
    first_state,
)

INITIAL: Place = ("agent", "initial")

CONTROLLER: Place = ("agent", "controller")


def require_apart(scenario: Scenario, paths: Sequence[str]) -> None:
    """Raise an error if two parameter paths denote the same number of a scenario.

    Raises:
        ScenarioError: names both.
    """
    # paths of one vehicle can only meet one another, as can those of all
    if scenario.is_team:
        for name in ("", *scenario.agents):
            own = [
                word_of(path) if name else path
                for path in paths
                if agent_of(path) == name
            ]
            one = [
                alone(scenario, path)[0] for path in paths if agent_of(path) == name
            ][:1]
            with errors_of_agent(name):
                require_apart(
                    one[0] if one else scenario.of(next(iter(scenario.agents))), own
                )
        return
    scenario = _with_initial_state(scenario, paths)
    seen: dict[Place, str] = {}
    viewed: dict[Place, str] = {}
    for path in paths:
        target = target_of(scenario, path)
        for place in target.names:
            if place in seen:
                raise ScenarioError(
                    f"path = {path!r}: is the same number as {seen[place]!r}; vary one"
                    " of them"
                )
            seen[place] = path
        if target.view is not None and not target.view.adds:
            viewed[target.places[0]] = path
    for place, path in seen.items():
        # the components of a quaternion are scaled together, and angles take the place
        # of all of them
        if place[:-2] in viewed and place[-2] == "quaternion":
            raise ScenarioError(
                f"path = {path!r}: must not vary together with {viewed[place[:-2]]!r}"
            )


def means_the_same(scenario: Scenario, path: str, other: str) -> bool:
    """True if two parameter paths denote the same number of a scenario."""
    if scenario.is_team and agent_of(path) != agent_of(other):
        return False
    (scenario, path), (_, other) = alone(scenario, path), alone(scenario, other)
    scenario = _with_initial_state(scenario, (path, other))
    return not set(places_of(scenario, path)).isdisjoint(places_of(scenario, other))


def is_added(scenario: Scenario, path: str) -> bool:
    """True if a parameter path denotes a payload mass, which adds to the vehicle's own
    mass.
    """
    try:
        scenario, path = alone(scenario, path)
        view = target_of(_with_initial_state(scenario, (path,)), path).view
    except ScenarioError:
        return False
    return view is not None and view.adds


def is_same_load(scenario: Scenario, path: str, other: str) -> bool:
    """True if two parameter paths denote the payload mass at one frame."""
    return (
        is_added(scenario, path)
        and is_added(scenario, other)
        and means_the_same(scenario, path, other)
    )


def is_computed(scenario: Scenario, path: str) -> bool:
    """True if the value at a path is computed from fields, or belongs to the reference
    or the initial state.
    """
    scenario, path = alone(scenario, path)
    target = target_of(_with_initial_state(scenario, (path,)), path)
    return target.view is not None or target.places[0][:2] in (
        INITIAL,
        ("agent", "reference"),
    )


def _with_initial_state(scenario: Scenario, paths: Iterable[str]) -> Scenario:
    """Scenario with an explicit initial state if a path leads into it: the stated one,
    else hover trim.
    """
    if not any(path.startswith("initial.") for path in paths):
        return scenario
    return scenario.with_initial(first_state(scenario))


def number_at(scenario: Scenario, path: str) -> float:
    """Value of the parameter at a dotted path of a scenario, such as
    plant.vehicle.base.mass.

    Raises:
        ScenarioError: a field that does not exist (with those that do), or something
            that is not a number.
    """
    one, word = alone(scenario, path)
    with errors_of_agent(agent_of(path) if word != path else ""):
        one = _with_initial_state(one, (word,))
        return _number(one, word, target_of(one, word))


def _number(scenario: Scenario, path: str, target: Target) -> float:
    value = part(scenario, target.places[0])
    if target.view is not None:
        seen: Viewed = value
        return seen.number_of_view(target.view.name)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ScenarioError(
            f"path = {path!r}: must lead to a number, not to {type(value).__name__}"
        )
    if (
        target.places[0][:2] != INITIAL
        and _declaration(scenario, target.places[0]).fixed
    ):
        raise ScenarioError(
            f"path = {path!r}: must be equal in all episodes and throughout a flight"
        )
    return float(value)


def with_numbers(scenario: Scenario, values: Mapping[str, Scalar]) -> Scenario:
    """Scenario with the parameters at some paths replaced; values may be symbols of a
    traced program.

    The mixer follows the model's rotors, a trimmed start the vehicle, and the setpoints
    that are on their way to a servo of the model its latency. What else a law's maker
    took from its model stays as it was made: gains, limits, first memory. A study of
    models therefore asks what a law does whose model is wrong in these numbers, not how
    it would be tuned for them.

    Args:
        scenario: scenario to change.
        values: path -> number.

    Raises:
        ScenarioError: as :func:`number_at`; or no mapping of paths to numbers.
        ValueError: a number that the scenario cannot have.
    """
    _require_numbers(values)
    # of several vehicles each is changed as the only one of its own flight, below
    if scenario.is_team:
        changed = by_agent(scenario, values, with_numbers)
        check_scenario(changed, numbers=True)
        return changed
    values = {alone(scenario, path)[1]: value for path, value in values.items()}
    started = _with_initial_state(scenario, values)
    fields: dict[Place, Scalar] = {}
    start: dict[Place, Scalar] = {}
    views: dict[Place, dict[str, Scalar]] = {}
    for path, value in values.items():
        target = target_of(started, path)
        _number(started, path, target)
        if target.view is None:
            # a start is completed by hover trim of what the other numbers make
            group = start if target.places[0][:2] == INITIAL else fields
            group.update(dict.fromkeys(target.places, value))
        else:
            views.setdefault(target.places[0], {})[target.view.name] = accept_scalar(
                path, value, target.view.unit
            )
    replaced = [*fields, *start, *views]
    angles = views.pop(INITIAL, {})
    changed = _replace_numbers(scenario, fields, views)
    law = [
        place[len(CONTROLLER) :]
        for place in fields
        if place[: len(CONTROLLER)] == CONTROLLER
    ]
    after = with_consequences(changed.agent.controller, law, scenario.rates.period)
    if after is not changed.agent.controller:
        changed = changed.with_controller(after)
    if start or angles:
        changed = changed.with_initial(_start_with(started, changed, start, angles))
    check_scenario(changed, replaced, numbers=True)
    return changed


def _replace_numbers(
    record: Record,
    fields: Mapping[Place, Scalar],
    views: Mapping[Place, Mapping[str, Scalar]],
) -> Record:
    """Copy of a record with some fields replaced first, then some values that are
    computed from several fields.

    A part with numbers that follow from others has a method ``with_followers``: places
    of the replaced ones in it -> the part with the others computed anew.
    """
    changed = replace_at(record, fields) if fields else record
    for place, numbers in views.items():
        viewed: Viewed = part(changed, place)
        changed = replace_at(changed, {place: viewed.with_views(numbers)})
    for owner in {place[:end] for place in fields for end in range(1, len(place))}:
        if hasattr(record_there := part(changed, owner), "with_followers"):
            own = {
                place[len(owner) :] for place in fields if place[: len(owner)] == owner
            }
            followed = record_there.with_followers(own)
            changed = (
                changed
                if followed is record_there
                else replace_at(changed, {owner: followed})
            )
    return changed


def _require_numbers(values: object) -> None:
    """Raise an error unless every parameter path is a text and every new value a
    scalar.

    Raises:
        ScenarioError: one line that names the wrong path or value.
    """
    if not isinstance(values, Mapping):
        raise ScenarioError(
            f"values = {shown(values)}: must be a mapping of paths to numbers"
        )
    for path, value in values.items():
        if not isinstance(path, str):
            raise ScenarioError(
                f"path = {shown(path)}: must be text, as 'plant.gravity'"
            )
        if type(value) is not float:
            with errors_as(ScenarioError):
                coerce.number(f"values[{path!r}]", value)


def _start_with(
    started: Scenario,
    changed: Scenario,
    fields: Mapping[Place, Scalar],
    angles: Mapping[str, Scalar],
) -> State:
    """Initial state with some numbers replaced: the stated one, else the hover trim of
    the changed vehicle.

    Args:
        started: scenario before the change, with an initial state.
        changed: scenario with all other numbers replaced.
        fields: place -> number, of the initial state.
        angles: angles of the attitude by name, rad.
    """
    inside = {place[len(INITIAL) :]: value for place, value in fields.items()}
    joints = {
        int(place[1]): value for place, value in inside.items() if place[0] == "joints"
    }
    initial, vehicle = changed.agent.initial, changed.agent.vehicle
    left_out: tuple[str, ...] = ()
    if initial is None or isinstance(initial, PartialState):
        left_out = (
            tuple(field_names(State) or ()) if initial is None else initial.left_out
        )
        if (
            changed.agent.plant is not started.agent.plant
            or changed.agent.reference is not started.agent.reference
            or joints
        ):
            at = first_state(changed)
            posture = replace(
                at,
                joints=tuple(joints.get(i, data(q)) for i, q in enumerate(at.joints)),
            )
            begun = PartialState.of(
                posture, [name for name in left_out if name != "joints"], vehicle
            )
            changed = changed.with_initial(begun)
        # with plain numbers, as any initial state has them
        initial = first_state(changed.with_initial(first_state(changed)))
    state = _replace_numbers(initial, inside, {(): angles} if angles else {})
    if not angles and any(place[0] == "quaternion" for place in inside):
        q, length = state.quaternion, state.quaternion.norm()
        state = replace(state, quaternion=Quaternion(*(divide(c, length) for c in q)))
    touched = {place[0] for place in inside} | ({"quaternion"} if angles else set())
    return PartialState.of(
        state, [name for name in left_out if name not in touched], vehicle
    )


LEFT_OUT = ("environment", "vehicle", "body", "value", "par")
"""Names of a parameter path that are left out of its readable form."""

WHOSE = {"plant": "plant", "model": "model", "controller": "law"}
"""First name of a parameter path -> owner of the number in the readable form."""


def unit_at(scenario: Scenario, path: str) -> str:
    """SI unit of the parameter at a path, from its field's declaration; empty if
    dimensionless or unknown.

    Raises:
        ScenarioError: no number is there.
    """
    return declared_at(scenario, path).unit


def declared_at(scenario: Scenario, path: str) -> Unit:
    """Unit, meaning and bounds declared for the parameter at a path.

    Of a joint, whose numbers have one unit if it turns and another if it slides, those
    of its kind; of a number of a signal, those of what the signal is.

    Raises:
        ScenarioError: no number is there.
    """
    scenario, path = alone(scenario, path)
    scenario = _with_initial_state(scenario, (path,))
    target = target_of(scenario, path)
    return (
        _declaration(scenario, target.places[0])
        if target.view is None
        else target.view.unit
    )


def _declaration(record: object, place: Place) -> Unit:
    """Unit declaration of the innermost field on a parameter's path that declares
    one.
    """
    unit = Unit()
    for name in place:
        if isinstance(record, tuple):
            record = record[int(name)]
            continue
        said = units(type(record)).get(name)
        if said is not None and not said.meaning.endswith(OF_SIGNAL):
            unit = said
        slides = getattr(record, "kind", "revolute") == "prismatic"
        if " or " in unit.unit and hasattr(record, "kind"):
            # "rad or m" is of a joint that turns, and of one that slides
            unit = replace(unit, unit=unit.unit.split(" or ")[1 if slides else 0])
        record = getattr(record, name)
    return unit


def words_of(path: str) -> str:
    """Parameter path in readable words: ``plant.vehicle.links.0.joint.damping`` is
    "link 1 joint damping (plant)".
    """
    names = [name for name in path.split(".") if name not in LEFT_OUT]
    whose = WHOSE.get(names[0], "") if len(names) > 1 else ""
    if whose:
        names = names[1:]
    if names[0] == "sensors" and len(names) == 2:
        return f"noise of {names[1].replace('_', ' ')}"
    terms: list[str] = []
    for word in names:
        if word.isdecimal() and terms:
            # of many items the name of one, as link of links, but mass stays mass
            one = terms[-1] if terms[-1].endswith("ss") else terms[-1].removesuffix("s")
            terms[-1] = f"{one} {int(word) + 1}"
        else:
            terms.append(word.removesuffix("_W").removesuffix("_B").replace("_", " "))
    return " ".join(terms) + (f" ({whose})" if whose else "")


def axis_label(text: str, unit: str) -> str:
    """Axis label: a text with its unit in brackets."""
    return f"{text} [{unit}]" if unit else text
