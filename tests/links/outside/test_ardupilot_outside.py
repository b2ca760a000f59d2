"""A law in one process, simulator and a real ArduPilot in another, by the commands that
users give.
"""

import os
import subprocess
import sys

import numpy as np
import pytest
from beside_px4 import Motion, mean_error, wait_for_port

from skyarm.links.autopilots.px4_ports import JOINT_PORT, ONBOARD_PORT
from skyarm.log.formats import load_log


@pytest.mark.thorough
@pytest.mark.skipif(
    "SKYARM_ARDUPILOT" not in os.environ,
    reason="SKYARM_ARDUPILOT does not name ArduPilot's program",
)
def test_a_law_flies_the_papers_circle_through_ardupilot(tmp_path):
    """Its satellite receiver is ArduPilot's own: the tip is 18 mm off, and the arm
    swings the base.
    """
    skyarm = [sys.executable, "-m", "skyarm"]
    command = [
        *skyarm,
        "run",
        "case3",
        "--autopilot",
        "ardupilot:outside",
        "--duration",
        "60",
        "--out",
        "sim",
    ]
    simulator = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.DEVNULL)
    try:
        wait_for_port(JOINT_PORT, simulator, 150.0)
        subprocess.run(
            [
                *skyarm,
                "fly",
                "case3",
                "--laws",
                "centroidal_tip",
                "--duration",
                "20",
                "--out",
                "law",
                "--rate-bandwidth",
                "18,18,6",
                "--link",
                f"mavlink://127.0.0.1:{ONBOARD_PORT}",
                "--joints",
                f"udp://127.0.0.1:{JOINT_PORT}",
            ],
            cwd=tmp_path,
            check=True,
            timeout=120.0,
        )
        simulator.wait(120.0)
    finally:
        simulator.kill()
    flown, truth = (
        load_log(tmp_path / "law" / "case3.npz"),
        load_log(tmp_path / "sim" / "case3.npz"),
    )
    assert (flown.status, truth.status, truth.info["autopilot"]["left_guided"]) == (
        "completed",
        "completed",
        0,
    )
    there, late = Motion.of(truth).moved(flown, truth), flown.time > 10.0
    shift = (flown.position - there.position)[late].mean(axis=0)
    assert mean_error((there.tool + shift - flown.tool_reference)[late]) < 40.0
    assert np.abs(shift).max() < 2.0
