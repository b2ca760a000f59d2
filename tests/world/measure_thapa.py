"""Measure Thapa's law in full dynamics: the table of docs/data/results_teams.md.

    python tests/world/measure_thapa.py [--small]

What of its internal force, speed and masses is left with rotors, attitude and noise.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

# the tests' own modules, when this is run as a program
sys.path.append(str(Path(__file__).parents[1]))

import skyarm
from skyarm.simulate.session import open_session
from skyarm.world.team import TeamMemory
from support.cables import NOISY, G, thapa
from support.measured_tables import print_table, progress


def adapted(tables: Mapping[str, Any]) -> tuple[Any, list[float]]:
    """Log of a flight, and the masses (kg) that its members have adapted at its end."""
    session = open_session(skyarm.scenario_from(tables))
    session.run()
    (memory,) = (
        each for each in session.now.components if isinstance(each, TeamMemory)
    )
    return session.log, [float(each.mass) for each in memory.own]  # type: ignore[attr-defined]


LOAD, CONTACT, STEP = 0.5, 2.5e5, 1e-5
"""Of Thapa's example: mass of the load (kg), stiffness of its contacts (N/m); and a
step (s) of its integration."""


def tips_alone(gain: float, duration: float = 1.0) -> tuple[float, float, float]:
    """Internal force (N), sum of the masses (kg) and share of the first of kinematic
    tips on a point mass.

    The published equations v_i = v_d + K (f_d - f_i) and m_i' = -c_i g (v_i - v_d)_z
    along the line of the tips and the vertical, without code of the library. Across,
    where no force acts, tips and load move at v_d.
    """
    masses, pull, tips, load, speed = [0.1, 0.1], 0.0, [0.0, 0.0], 0.0, 0.0
    forces = [0.0, 0.0]
    for _ in range(round(duration / STEP)):
        # of the tips on the load, vertical
        forces = [CONTACT * (z - load) for z in tips]
        speed += STEP * (sum(forces) / LOAD - G)
        load += STEP * speed
        rates = [
            gain * (m * G - force) for m, force in zip(masses, forces, strict=True)
        ]
        tips = [z + STEP * rate for z, rate in zip(tips, rates, strict=True)]
        masses = [
            m - STEP * c * G * rate
            for m, c, rate in zip(masses, (0.6, 0.4), rates, strict=True)
        ]
        pull += STEP * CONTACT * gain * (2.0 - pull)
    return pull, sum(masses), forces[0] / sum(forces)


def thapas(small: bool) -> Iterator[tuple[object, ...]]:
    """Rows: dynamics, gain, internal force, speed and masses in the last five seconds,
    and how the flight ended.
    """
    force, mass, first = tips_alone(0.1)
    yield (
        "tips alone",
        "0.1",
        f"{force:.3f}",
        "",
        "",
        f"{mass:.4f}",
        f"{100.0 * first:.0f}",
        "1 s",
    )
    rows = [("perfect state", k, {}) for k in (0.1, 0.05, 0.02, 0.002)]
    rows += [("noise and 5 ms", k, NOISY) for k in (0.1, 0.02)]
    for words, gain, more in rows[2:3] if small else rows:
        log, masses = adapted({**thapa(gain, duration=2.0 if small else 20.0), **more})
        if log.info["status"] != "completed":
            yield (
                words,
                f"{gain:g}",
                "",
                "",
                "",
                "",
                "",
                f"`{log.info['status']}` at {log.time[-1]:.1f} s",
            )
            continue
        late = log.time > log.time[-1] - 5.0
        pull, share = log.team_pull[late], 100.0 * log.load_share[late, 0].mean()
        numbers = (
            f"{pull.mean():.3f}",
            f"{pull.std():.3f}",
            f"{log.object_velocity[late, 0].mean():.4f}",
        )
        yield (
            words,
            f"{gain:g}",
            *numbers,
            f"{sum(masses):.4f}",
            f"{share:.0f}",
            f"{log.time[-1]:.0f} s",
        )


HEADS = (
    "flown",
    ">gain, m/(N s)",
    ">internal force, N",
    ">its deviation, N",
    ">speed, m/s",
    ">sum of the masses, kg",
    ">share of the first, %",
    "end",
)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--small", action="store_true", help="one short flight: seconds"
    )
    given = parser.parse_args()
    progress("six flights of 20 s:")
    print_table(HEADS, thapas(given.small))


if __name__ == "__main__":
    main()
