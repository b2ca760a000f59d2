"""Drawn measurements and references of exported laws, and the comparison of their
bits.
"""

from __future__ import annotations

import dataclasses

import numpy as np

import skyarm
from skyarm.control.catalogue import Controller
from skyarm.control.onboard.export_c import export_c
from support.laws import G, cases, changed, hovering


def text_of(controller: Controller, name: str = "law", **options) -> str:
    return export_c(controller, name=name, period=0.005, **options).text


def same_bits(found, wanted) -> bool:
    """Equal to the last bit, every NaN alike."""
    a, b = np.array(found), np.array(wanted)
    return bool(
        np.all((a.view(np.uint64) == b.view(np.uint64)) | (np.isnan(a) & np.isnan(b)))
    )


def inputs(vehicle: str, count: int = 20, seed: int = 5, preview: int = 0):
    """Drawn measurements and references, with some samples to come (``preview``
    instants).
    """
    loaded = skyarm.load_vehicle(vehicle)
    rng = np.random.default_rng(seed)
    for measurement, reference in held_inputs(loaded, count, seed):
        ahead = rng.normal(0.0, 0.5, 3 * (4 + loaded.n) * preview)
        yield measurement, dataclasses.replace(reference, ahead=tuple(ahead.tolist()))


def held_inputs(loaded, count: int, seed: int):
    drawn = [*cases(count, seed, joints=loaded.n), hovering(joints=(0.0,) * loaded.n)]
    # no commanded force: the guarded case
    drawn.append(changed(drawn[-1], a_d=(0.0, 0.0, -G)))
    for case in drawn:
        measurement = dataclasses.replace(
            case.measurement(), rotor_speeds=(480.0,) * len(loaded.rotors)
        )
        yield measurement, case.reference()
