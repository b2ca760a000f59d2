"""Flags with which XLA compiles stepped programs well for a CPU; to be set before JAX starts."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

EXTRA_OPTIONS = (
    "--xla_backend_extra_options=xla_cpu_small_while_loop_byte_threshold=100000000,"
    "xla_cpu_use_multi_output_fusion,xla_cpu_flatten_after_fusion"
)
"""Options of XLA's backend for processors; a jaxlib that does not know one of them passes over it."""

CPU_FLAGS = ("--xla_cpu_prefer_vector_width=512", EXTRA_OPTIONS)
"""What makes XLA compile a block of lanes as one SIMD loop: 3.4 times faster together, little each alone."""


class JaxStartedError(RuntimeError):
    """A setting came after JAX had read it."""


def configure_cpu() -> None:
    """Set XLA's flags for stepped programs on a CPU, in ``XLA_FLAGS`` of this process.

    Call it before anything is computed with JAX. A flag that is already set stays as it is. A jaxlib that no longer
    knows a flag ends the process with that flag's name; jaxlib 0.10 knows them all.

    Raises:
        JaxStartedError: JAX has started and would not read them.
    """
    if not _set(CPU_FLAGS):
        raise JaxStartedError(
            "JAX has started and reads XLA_FLAGS only then: call configure_cpu() before the first array"
        )


def configure_extra_options() -> bool:
    """Set those of the flags that no jaxlib refuses, unless they are set; False if JAX runs on a CPU without them."""
    return _set([EXTRA_OPTIONS]) or sys.modules["jax"].default_backend() != "cpu"


def _set(flags: Sequence[str]) -> bool:
    """Add the flags that are not set yet; False, and nothing done, if JAX would not read them any more."""
    present = os.environ.get("XLA_FLAGS", "").split()
    wanted = [flag for flag in flags if not any(old.split("=")[0] == flag.split("=")[0] for old in present)]
    if wanted and _has_started():
        return False
    if wanted:
        os.environ["XLA_FLAGS"] = " ".join([*present, *wanted])
    return True


def _has_started() -> bool:
    """True if JAX has made a backend; JAX has no public function for it."""
    bridge = sys.modules.get("jax._src.xla_bridge")
    asked = getattr(bridge, "backends_are_initialized", None)
    return bool(asked()) if asked is not None else "jax" in sys.modules
