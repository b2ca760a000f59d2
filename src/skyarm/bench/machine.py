"""The machine a measurement belongs to."""

from __future__ import annotations

import os
import platform
from pathlib import Path
from typing import Any

from skyarm.compile.llvm.kernel import host_width
from skyarm.files.packages import ABSENT, versions


def cores() -> int:
    """Cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def describe() -> dict[str, Any]:
    """Processor, cores, vector width, load before the measurement, versions."""
    import llvmlite.binding as llvm

    found: dict[str, Any] = {
        "processor": _model(),
        "llvm_processor": llvm.get_host_cpu_name(),
        "cores": cores(),
        "lanes_f64": host_width(),
        "system": f"{platform.system()} {platform.machine()}",
    }
    if hasattr(os, "getloadavg"):
        found["load_before"] = round(os.getloadavg()[0], 2)
    there = versions("numpy", "llvmlite", "mujoco-core", "jax", "pin")
    return found | {name: None if version == ABSENT else version for name, version in there.items()}


def _model() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or "unknown"
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or "unknown"
