"""Clusters that are begun, left, interrupted or not there: one line, nothing left
behind, rows kept.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import cloudpickle
import pytest
from ray_stand import Program, cluster

from skyarm.records.travel import luggage, pack
from skyarm.studies.flights import ray_cluster
from skyarm.studies.flights.ray_cluster import Ray
from skyarm.studies.sweep import run_sweep
from support.cases import toml_text
from support.studies import document, files_of, small_study

posix = pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")

SMALL: dict[str, Any] = {
    "precision": "bit_exact",
    "episodes": 400,
    "chunk": 4,
    "duration": 2.0,
}

SWEEP = """
import json, sys
from pathlib import Path
from skyarm.studies.sweep import run_sweep
from support.studies import small_study

if __name__ == "__main__":
    out, on, fields = Path(sys.argv[1]), sys.argv[2], json.loads(sys.argv[3])
    def told(there, of):
        TOLD
    run_sweep(small_study(**fields), out / "rows", on=on, workers=2, progress=told)
"""


LOOKS = """
        import ray, socket
        if not ray.is_initialized():
            return
        port = int(ray.get_runtime_context().gcs_address.rpartition(":")[2])
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as outward:
            outward.connect(("192.0.2.1", 9))
            here = outward.getsockname()[0]
        try:
            socket.create_connection((here, port), 2.0).close()
            found = "open"
        except OSError:
            found = "closed"
        socket.create_connection(("127.0.0.1", port), 2.0).close()
        print(ray.nodes()[0]["NodeManagerAddress"], found)
"""


def swept(folder: Path, on: str, *words: str, **fields: Any) -> Program:
    """``skyarm sweep`` of a small study into ``rows``."""
    (folder / "small.toml").write_text(toml_text(document(**SMALL | fields)))
    return Program(
        folder,
        "-m",
        "skyarm",
        "sweep",
        "small.toml",
        "--out",
        "rows",
        "--on",
        on,
        "--workers",
        "2",
        *words,
    )


def wait_for_files(folder: Path, count: int, seconds: float = 60.0) -> None:
    """Wait until so many files are in a folder."""
    end = time.monotonic() + seconds
    while not folder.is_dir() or len([*folder.glob("*.parquet")]) < count:
        assert time.monotonic() < end, f"{folder} stays without {count} files"
        time.sleep(0.01)


def performing(seconds: float) -> list[str]:
    """Processes of nodes that still execute a call after some seconds."""
    end = time.monotonic() + seconds
    while True:
        lines = []
        for file in Path("/proc").glob("[0-9]*/cmdline"):
            with contextlib.suppress(OSError):
                lines.append(file.read_bytes().decode(errors="replace"))
        found = [line for line in lines if line.startswith("ray::perform_there")]
        if not found or time.monotonic() > end:
            return found
        time.sleep(0.2)


def test_a_missing_package_is_one_line_with_its_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(
        ValueError, match=r"^on = 'ray': needs the extra 'ray': python -m pip install "
    ):
        run_sweep(small_study(**SMALL), tmp_path / "rows", on="ray")
    assert not (tmp_path / "rows").exists()


def test_what_a_node_executes_needs_no_skyarm_to_say_that_there_is_none() -> None:
    program = (
        "import pickle, sys; sys.modules['skyarm'] = None; perform ="
        " pickle.loads(sys.stdin.buffer.read())\ntry: perform({'skyarm': '7.8'}, b'',"
        " b'')\nexcept ValueError as error: print(error)"
    )
    content = cloudpickle.dumps(ray_cluster._travelling())
    done = subprocess.run(
        [sys.executable, "-c", program], input=content, capture_output=True, check=True
    )
    line = done.stdout.decode()
    assert line.startswith(
        f"node {socket.gethostname()} cannot fly works (No module named"
        " 'skyarm.studies'"
    )
    assert line.endswith("): must have skyarm 7.8\n")
    assert line.count("\n") == 1


def test_a_process_of_another_version_refuses_and_one_of_the_same_performs() -> None:
    must_be, outfit, call = (
        ray_cluster.kin(),
        pack((luggage(), set())),
        pack((divmod, (17, 5))),
    )
    assert must_be["python"] == f"{sys.version_info.major}.{sys.version_info.minor}"
    other = {**must_be, "pyarrow": "1.0", "code": "f" * 64, "new": "3"}
    here = f"code {must_be['code'][:12]}, pyarrow {must_be['pyarrow'][:12]}, new none"
    with pytest.raises(ValueError) as told:  # noqa: PT011
        ray_cluster.perform_on_node(other, outfit, call)
    node = f"node {socket.gethostname()} has {here}"
    assert (
        str(told.value)
        == f"{node}: must have code ffffffffffff, pyarrow 1.0, new 3, as the driver"
    )
    assert ray_cluster.perform_on_node(must_be, outfit, call) == (3, 2)


class TestWithRay:
    """Needs the package."""

    @pytest.fixture(autouse=True)
    def _package(self) -> None:
        pytest.importorskip("ray", reason="needs the extra ray: make ray")

    @pytest.mark.parametrize(
        "address", ["127.0.0.1:1", "no.such.host.invalid:6379", "127.0.0.1:99999"]
    )
    def test_an_address_where_nobody_listens_is_one_line_within_seconds(
        self, tmp_path: Path, address: str
    ) -> None:
        begin = time.monotonic()
        with pytest.raises(
            ValueError, match=rf"^on = 'ray:{address}': nobody answers there \(.+\)$"
        ):
            run_sweep(small_study(**SMALL), tmp_path / "rows", on=f"ray:{address}")
        assert time.monotonic() - begin < 10.0
        assert not (tmp_path / "rows").exists()

    def test_what_answers_but_is_no_cluster_is_one_line(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(ray_cluster, "JOIN_SECONDS", 3.0)
        with socket.create_server(("127.0.0.1", 0)) as server:
            address = f"127.0.0.1:{server.getsockname()[1]}"
            with pytest.raises(
                ValueError,
                match=(
                    rf"^on = 'ray:{address}': what answers there is no head of a Ray"
                    r" cluster$"
                ),
            ):
                Ray(address, 1)

    @posix
    def test_a_cluster_begun_here_is_reached_from_here_alone_prints_nothing_and_ends(
        self, tmp_path: Path
    ) -> None:
        program = Program.of_text(
            tmp_path,
            SWEEP.replace("TOLD", LOOKS),
            "ray",
            json.dumps(SMALL | {"episodes": 8}),
        )
        code, out, err = program.end()
        assert (code, err) == (0, "")
        assert set(out.splitlines()) == {"127.0.0.1 closed"}
        assert program.left() == []

    @posix
    @pytest.mark.parametrize("begun", [True, False])
    def test_an_interrupt_leaves_no_task_and_a_folder_that_goes_on(
        self, tmp_path: Path, begun: bool
    ) -> None:
        with contextlib.nullcontext() if begun else cluster() as nodes:
            program, rows = (
                swept(tmp_path, "ray" if begun else f"ray:{nodes.address}"),
                tmp_path / "rows" / "rows",
            )
            wait_for_files(rows, 12)
            os.killpg(program.process.pid, signal.SIGINT)  # as Ctrl-C in a terminal
            code, out, err = program.end(60.0)
            assert (code, out) == (130, ""), err
            assert err.endswith(
                "interrupted; finished files are whole; the same command goes on\n"
            )
            assert program.left() == []
            assert performing(10.0) == []
        kept = [*rows.glob("*.parquet")]
        assert 12 <= len(kept) < 2 * SMALL["episodes"] // SMALL["chunk"]
        study = small_study(**SMALL)
        assert run_sweep(study, tmp_path / "rows", workers=2).found >= 4
        run_sweep(study, tmp_path / "whole", workers=2)
        assert files_of(tmp_path / "rows") == files_of(tmp_path / "whole")

    @posix
    @pytest.mark.thorough
    def test_a_killed_driver_leaves_no_process_after_two_minutes(
        self, tmp_path: Path
    ) -> None:
        program = swept(tmp_path, "ray")
        wait_for_files(tmp_path / "rows" / "rows", 4)
        program.process.kill()
        program.end()
        assert program.left(120.0) == []

    @posix
    def test_the_command_prints_one_document_and_nothing_of_ray(
        self, tmp_path: Path
    ) -> None:
        # a slow machine prints progress
        program = swept(tmp_path, "ray", "--json", "--quiet", episodes=8)
        code, out, err = program.end()
        assert (code, err) == (0, "")
        assert json.loads(out)["rows"] == 16
        assert program.left() == []

    @posix
    def test_the_command_refuses_an_address_where_nobody_is_in_one_line(
        self, tmp_path: Path
    ) -> None:
        code, out, err = swept(tmp_path, "ray:127.0.0.1:1", "--quiet").end()
        assert (code, out) == (2, "")
        assert (
            err == "skyarm: on = 'ray:127.0.0.1:1': nobody answers there (Connection"
            " refused)\n"
        )
        assert not (tmp_path / "rows").exists()

    @posix
    def test_whoever_leaves_a_cluster_leaves_no_call_there(self) -> None:
        with cluster() as nodes:
            performs = Ray(nodes.address, 1)
            for _ in range(4):
                performs.submit(0, time.sleep, 300.0)
            end = time.monotonic() + 30.0
            while not performing(0.0) and time.monotonic() < end:
                time.sleep(0.1)
            assert performing(0.0) != []
            performs.close(abandon=True)
            assert performing(10.0) == []

    @posix
    def test_a_cluster_that_the_script_has_joined_stays_joined(self) -> None:
        import ray

        with cluster() as nodes:
            ray.init(address=nodes.address, log_to_driver=False)
            try:
                with pytest.raises(
                    ValueError,
                    match=(
                        rf"this process has joined {nodes.address}; must be ray, or"
                        r" that"
                    ),
                ):
                    Ray("10.0.0.1:6379", 1)
                performs = Ray("", 1)
                assert performs.slots == 4
                nodes.add_node(num_cpus=3)
                for k in (3, 5):
                    performs.submit(k, divmod, 17, k)
                assert performs.flying == 2
                assert sorted(performs.collect() for _ in range(2)) == [
                    (3, (5, 2)),
                    (5, (3, 2)),
                ]
                performs._counted -= ray_cluster.LOOK_SECONDS
                assert performs.slots == 10, "what has come meanwhile flies, too"
                performs.submit(0, os._exit, 1)
                with pytest.raises(
                    OSError,
                    match=(
                        r"^on = 'ray': a process or node ended unexpectedly, 4 times: "
                    ),
                ):
                    performs.collect()
                performs.submit(0, time.sleep, 60.0)
                performs.submit("large", bytes, 1_000_000)
                performs.submit("fails", divmod, 1, 0)
                # two of the three are over
                ray.wait([*performs._flying], num_returns=2)
                assert performs.close(abandon=True) == [("large", bytes(1_000_000))]
                assert performing(10.0) == []
                assert ray.is_initialized()
            finally:
                ray.shutdown()
