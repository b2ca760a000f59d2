"""Tuning of a law's gains for one vehicle and its loop, from a scenario to a front and a pick.

The search flies :func:`skyarm.tune.excitation.excited` through wrong plants, each with a motion of its own, every
fourth with the scenario's where there is one; its best candidates from calm to stiff fly further plants, and what is
left of them others again, along the scenario's own motion, and have their margins computed in hover. The gains that
were given and those of the catalogue for this law go all that way with them. What is picked follows from
:data:`skyarm.tune.front.RULE`; at last it and all starts fly plants and a path by which nothing was chosen, and that is
what is said of them.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from skyarm.files.writing import one_writer
from skyarm.tune.archive import Archive
from skyarm.tune.blas_threads import threadpool_limits
from skyarm.tune.conductor import SEMIFINALISTS, Conductor, Progress
from skyarm.tune.front import finalists, front_of
from skyarm.tune.gain_search import search
from skyarm.tune.hover_margins import required
from skyarm.tune.known_gains import centred
from skyarm.tune.plant_spread import draw_plants
from skyarm.tune.tuning_records import PICKED, Plan, Tuning


def tune(plan: Plan, folder: Path, *, threads: int = 1, progress: Progress | None = None) -> Tuning:
    """Tune, or go on with a search that the folder holds a part of.

    Args:
        plan: what is tuned.
        folder: of the archive; it is there.
        threads: results do not depend on it.
        progress: told of every round.

    Raises:
        ValueError: the folder holds a search of something else, or is written by another process.
    """
    start = centred(plan.flight, plan.knobs, plan.label)
    law = start.flight.controller
    plan = dataclasses.replace(
        plan,
        flight=start.flight,
        check=dataclasses.replace(plan.check, controller=law),
        aside=dataclasses.replace(plan.aside, controller=law),
        own=dataclasses.replace(plan.own, controller=law) if plan.own else None,
        knobs=start.knobs,
    )
    with one_writer(folder), threadpool_limits(1, user_api="blas"):
        archive = Archive(folder, plan.facts())
        plants = draw_plants(plan.flight, plan.effort.plants, seed=plan.seed, mixed=True)
        conductor = Conductor(plan, plants, archive, threads, progress or (lambda *_: None))
        try:
            logs, found = search(plan.knobs, plan.effort, conductor.judge, seed=plan.seed, starts=start.rows)
            # of the scatter nobody flew all plants; the starts come along
            best = len(found[0].error) + np.array(finalists(found[1:], SEMIFINALISTS))
            count = len(start.starts)
            asked = logs[[*range(count), *best]]
            again, drawn = conductor.again(asked)
            last = [*range(count), *(count + k for k in finalists([again.part(slice(count, None))]))]
            points = conductor.check(asked[last], drawn.part(last))
            wanted = required(plan.flight)
            front, picked = front_of(points[:count], points[count:], wanted)
            known = dict(zip(start.starts, points, strict=False))
            aside = conductor.fly_aside({**known, PICKED: front[picked]})
        finally:
            conductor.close()
    return Tuning(
        plan=plan,
        before=points[0],
        points=tuple(front),
        picked=picked,
        required=wanted,
        plants=plants,
        aside=aside,
    )
