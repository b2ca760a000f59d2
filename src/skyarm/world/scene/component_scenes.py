"""Scene of the environment components of a flight, from its log or at its current
instant.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from skyarm.dynamics.point_motion import PointMotion
from skyarm.records.arrays import Array, doubles
from skyarm.records.files.names import distinct
from skyarm.records.files.user_code import require_result
from skyarm.records.leaves import Tree
from skyarm.world.component import COLLISIONS, Component, by_array
from skyarm.world.scene.scene import Instants, Scene
from skyarm.world.scene.shapes import KINDS


def scene_in_log(
    components: Sequence[Component[Tree]],
    seen: Instants,
    logged: Callable[[str], Array],
) -> Scene:
    """Drawn solids, lines and arrows of a flight, from its log.

    Args:
        components: environment models of the scenario, with concrete numbers.
        seen: the instants, without numbers of a part.
        logged: array -> its columns (N, k) of all parts at these instants; (N, 0) of
            one that there is not.
    """
    return _scene(
        (part, replace(seen, numbers=own))
        for part, own in _own_columns(components, logged)
    )


def scene_now(
    components: Sequence[Component[Tree]],
    memories: Sequence[Tree],
    seen: Instants,
    motion: PointMotion,
) -> Scene:
    """Drawn solids, lines and arrows of a running flight at the current instant.

    Args:
        components: environment models of the scenario.
        memories: internal state of each.
        seen: the instant.
        motion: motion of the vehicle then.
    """
    parts = []
    for part, memory in zip(components, memories, strict=True):
        if has_shapes(part):
            own = by_array([part], part.logged(memory, motion))
            numbers = {name: doubles([row]) for name, row in own.items()}
            parts.append((part, replace(seen, numbers=numbers)))
    return _scene(parts)


def scenes_of(
    names: Iterable[str], draw: Callable[[str, bool], Scene], *, attached: bool = True
) -> Iterator[Scene]:
    """Scene of each vehicle of a flight: what all share with the first one, of others
    what each has for itself.

    Args:
        names: names of the vehicles.
        draw: function that draws the environment models which a vehicle has for itself,
            and if its flag is true those that all share.
        attached: True to draw the shapes on the bodies of the other vehicles, too,
            which belong to shared models.
    """
    for i, name in enumerate(names):
        scene = draw(name, not i)
        yield (
            replace(scene, attached=draw(name, True).attached)
            if i and attached
            else scene
        )


def has_shapes(part: Component[Tree]) -> bool:
    """True if the environment model draws anything in pictures."""
    return type(part).shapes is not Component.shapes


def _own_columns(
    components: Sequence[Component[Tree]], logged: Callable[[str], Array]
) -> Iterator[tuple[Component[Tree], Mapping[str, Array]]]:
    """Environment models that draw something, each with its columns of the flight
    log.
    """
    begins = Counter[str]()
    declared = Counter(column[0] for part in components for column in part.columns)
    # of a member of a team that is drawn alone the log has pairs with the others, too
    unknown = {
        name
        for name in COLLISIONS
        if declared[name] and logged(name).shape[1] > declared[name]
    }
    for part in components:
        own = Counter(column[0] for column in part.columns)
        if has_shapes(part):
            columns = {
                # zeros of an unknown force draw no arrow
                name: logged(name)[:, begins[name] :][:, :count] * (name not in unknown)
                for name, count in own.items()
            }
            # a log may lack columns of a part, which is then not drawn
            if all(columns[name].shape[1] == count for name, count in own.items()):
                yield part, columns
        begins.update(own)


def _scene(parts: Iterable[tuple[Component[Tree], Instants]]) -> Scene:
    """Merge the drawn solids, lines and arrows of all environment models."""
    scenes = [_drawn(part, seen) for part, seen in parts]
    solids = [solid for each in scenes for solid in each.solids]
    lines = [line for each in scenes for line in each.lines]
    of_solids, of_lines = map(
        distinct, ([s.shape.name for s in solids], [s.name for s in lines])
    )
    return Scene(
        solids=tuple(
            replace(s, shape=replace(s.shape, name=name))
            for s, name in zip(solids, of_solids, strict=True)
        ),
        lines=tuple(
            replace(line, name=name) for line, name in zip(lines, of_lines, strict=True)
        ),
        arrows=tuple(arrow for each in scenes for arrow in each.arrows),
        attached=tuple(shape for each in scenes for shape in each.attached),
        ground=max(
            (each.ground for each in scenes if each.ground is not None), default=None
        ),
    )


def _drawn(part: Component[Tree], seen: Instants) -> Scene:
    """Drawn solids, lines and arrows of one environment model.

    Raises:
        ValueError: it cannot be drawn; one line with the method's file.
    """
    scene = part.shapes(seen)
    function = part.shapes
    require_result(
        function, scene, isinstance(scene, Scene), "a skyarm.world.scene.Scene"
    )
    for shape in (*scene.attached, *(each.shape for each in scene.solids)):
        require_result(
            function,
            shape,
            shape.kind in KINDS,
            f"of one of the kinds {', '.join(KINDS)}",
        )
    for line in scene.lines:
        allowed = f"with places of shape (N, K, 3) at N = {len(seen.times)} instants"
        size = np.shape(line.places)
        require_result(
            function, line, size == (len(seen.times), *size[1:2], 3), allowed
        )
    return scene
