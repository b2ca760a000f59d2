"""Rows of a Ray cluster: those of this process to the byte, whoever's laws and metrics,
whatever dies.
"""

from __future__ import annotations

import json
import random
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from ray_stand import Program, cluster

from skyarm.studies.flights import ray_cluster
from skyarm.studies.sweep import run_sweep
from support.studies import files_of, small_study

ray = pytest.importorskip("ray", reason="needs the extra ray: make ray")
pytestmark = pytest.mark.skipif(
    sys.platform == "win32", reason="clusters of several nodes on one machine"
)

STUDY: dict[str, Any] = {
    "precision": "bit_exact",
    "episodes": 48,
    "chunk": 8,
    "duration": 0.5,
}
STUDY["windows"] = {"steady": [0.2, 0.5]}


@pytest.fixture(scope="module")
def nodes() -> Iterator[Any]:
    with cluster() as found:
        yield found


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("whole")
    run_sweep(small_study(**STUDY), folder)
    return files_of(folder)


def test_local_processes_and_two_nodes_fly_the_same_bytes(
    tmp_path: Path, nodes: Any, whole: dict[str, bytes]
) -> None:
    run_sweep(small_study(**STUDY), tmp_path / "processes", on="processes", workers=2)
    flown = run_sweep(small_study(**STUDY), tmp_path / "ray", on=f"ray:{nodes.address}")
    assert flown.flown == STUDY["episodes"]
    assert files_of(tmp_path / "ray") == files_of(tmp_path / "processes") == whole
    assert not ray.is_initialized()


LONGER = STUDY | {"episodes": 240, "duration": 2.0}


@pytest.fixture(scope="module")
def longer(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("longer")
    run_sweep(small_study(**LONGER), folder)
    return files_of(folder)


@pytest.mark.parametrize(
    "seed", [0, 1, *(pytest.param(k, marks=pytest.mark.thorough) for k in range(2, 20))]
)
def test_a_node_killed_in_flight_costs_its_works_alone(
    tmp_path: Path, longer: dict[str, bytes], seed: int
) -> None:
    dice, reports, killed = random.Random(seed), list[int](), list[int]()
    with cluster() as nodes:
        (second,) = nodes.worker_nodes

        def kill() -> None:
            after = dice.randrange(1, 25)
            while len(reports) < after:
                time.sleep(0.002)
            time.sleep(dice.uniform(0.0, 0.02))
            nodes.remove_node(second, allow_graceful=False)
            killed.append(reports[-1])

        killer = threading.Thread(target=kill, daemon=True)
        killer.start()
        study = small_study(**LONGER)
        run_sweep(
            study,
            tmp_path,
            on=f"ray:{nodes.address}",
            progress=lambda there, _: reports.append(there),
        )
        killer.join(30.0)
    assert killed[0] < LONGER["episodes"] == reports[-1]
    assert files_of(tmp_path) == longer


OWN = """
import json, shutil, sys
from dataclasses import dataclass
from pathlib import Path

import skyarm
from skyarm.algebra import scalars
from skyarm.studies.sweep import run_sweep
from support.studies import files_of, small_study

PLUGIN = '''
import skyarm
from gain_beside import GAIN

@skyarm.register.law("from_a_file")
def make(model):
    base = skyarm.preset("paper_pd", model)

    def law(memory, measurement, reference, dt, *, par):
        memory, command = base.law(memory, measurement, reference, dt, par=par)
        speeds = tuple(GAIN * speed for speed in command.rotor_speeds)
        return memory, skyarm.Command(rotor_speeds=speeds, efforts=command.efforts)

    return skyarm.Controller(
        name="from_a_file", law=law, par=base.par, memory=base.memory
    )
'''

@skyarm.register.law("made_here")
def make(model):
    base, gain = skyarm.preset("paper_pd", model), 1.002

    def law(memory, measurement, reference, dt, *, par):
        memory, command = base.law(memory, measurement, reference, dt, par=par)
        speeds = tuple(gain * speed for speed in command.rotor_speeds)
        return memory, skyarm.Command(rotor_speeds=speeds, efforts=command.efforts)

    return skyarm.Controller(
        name="made_here", law=law, par=base.par, memory=base.memory
    )

@skyarm.register.metric("highest")
@dataclass(frozen=True)
class Highest(skyarm.Metric):
    def start(self):
        return (0.0,)

    def count(self, memory, now):
        return (scalars.maximum(memory[0], now.state.position.z),)

    def result(self, memory, instants, period):
        return memory[0]

if __name__ == "__main__":
    out, address, fields = Path(sys.argv[1]), sys.argv[2], json.loads(sys.argv[3])
    folder = out / "plugin"
    folder.mkdir()
    (folder / "mine.py").write_text(PLUGIN)
    (folder / "gain_beside.py").write_text("GAIN = 1.001")
    sys.path.insert(0, str(folder))
    skyarm.load_plugin(folder / "mine.py")
    sys.path.remove(str(folder))
    shutil.rmtree(folder)
    laws = ["paper_pd", "from_a_file", "made_here"]
    study = small_study(**fields, controllers=laws, metrics=["highest", "tilt_max"])
    found = {}
    for on in ("local", "processes", f"ray:{address}"):
        run_sweep(study, out / on[:3], on=on, workers=2)
        found[on] = files_of(out / on[:3])
    first = found["local"]
    same = [each == first for each in found.values()]
    print(json.dumps({"same": same, "files": [*first]}))
"""


def test_laws_of_lost_files_laws_of_functions_and_metrics_of_a_script_travel(
    tmp_path: Path, nodes: Any
) -> None:
    program = Program.of_text(tmp_path, OWN, nodes.address, json.dumps(STUDY))
    code, out, err = program.end()
    assert code == 0, err
    found = json.loads(out)
    assert found["same"] == [True, True, True]
    assert len(found["files"]) == 3 * STUDY["episodes"] // STUDY["chunk"] + 1
    assert program.left() == []


WRONG = """
import json, sys
from pathlib import Path

import skyarm
from skyarm.studies.sweep import run_sweep
from support.studies import small_study

PLUGIN = '''
import skyarm

@skyarm.register.law("fails")
def make(model):
    base = skyarm.preset("paper_pd", model)

    def law(memory, measurement, reference, dt, *, par):
        return memory[len(memory) + 7], base

    return skyarm.Controller(name="fails", law=law, par=base.par, memory=base.memory)
'''

if __name__ == "__main__":
    out, address, fields = Path(sys.argv[1]), sys.argv[2], json.loads(sys.argv[3])
    (out / "fails.py").write_text(PLUGIN)
    skyarm.load_plugin(out / "fails.py")
    found = []
    for on in ("local", "processes", f"ray:{address}"):
        try:
            study = small_study(**fields, controllers=["fails"])
            run_sweep(study, out / on[:3], on=on, workers=2)
        except Exception as error:
            found.append([type(error).__name__, str(error)])
    print(json.dumps(found))
"""


def test_an_error_of_own_code_is_the_same_line_from_everywhere(
    tmp_path: Path, nodes: Any
) -> None:
    code, out, err = Program.of_text(
        tmp_path, WRONG, nodes.address, json.dumps(STUDY)
    ).end()
    assert code == 0, err
    local, processes, cluster_s = json.loads(out)
    assert processes == cluster_s
    assert processes[0] == "OwnCodeError"
    assert processes[1].endswith("fails.py:9: IndexError: tuple index out of range")
    assert local == ["IndexError", "tuple index out of range"]


def test_another_version_is_refused_before_it_flies(
    tmp_path: Path, nodes: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    true = ray_cluster.kinship()
    monkeypatch.setattr(
        ray_cluster,
        "kinship",
        lambda: true | {"numpy": "1.0", "code": "0123456789abcdef"},
    )
    with pytest.raises(
        ValueError,
        match=(
            r"^node \S+ has numpy [2-9]\S*, code \w{12}: must have numpy 1\.0, code"
            r" 0123"
        ),
    ) as told:
        run_sweep(small_study(**STUDY), tmp_path / "rows", on=f"ray:{nodes.address}")
    assert "\n" not in str(told.value)
    assert not list(tmp_path.rglob("*.parquet"))
