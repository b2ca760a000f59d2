"""XLA options for fast stepped programs on a CPU; must be set before JAX starts."""

from __future__ import annotations

import os
import sys

EXTRA_OPTIONS = (
    "--xla_backend_extra_options=xla_cpu_small_while_loop_byte_threshold=100000000,"
    "xla_cpu_use_multi_output_fusion,xla_cpu_flatten_after_fusion"
)
"""XLA options for CPUs; a jaxlib that does not support one of them ignores it."""


def configure_extra_options() -> bool:
    """Add CPU options of XLA to ``XLA_FLAGS``; False if JAX already runs on a CPU
    without these options.
    """
    present = os.environ.get("XLA_FLAGS", "").split()
    # set before, or by the user, whose value stays
    if any(
        flag.split("=")[0] == EXTRA_OPTIONS.split("=", maxsplit=1)[0]
        for flag in present
    ):
        return True
    # XLA reads its options once, when the first backend starts
    if _has_started():
        return bool(sys.modules["jax"].default_backend() != "cpu")
    os.environ["XLA_FLAGS"] = " ".join([*present, EXTRA_OPTIONS])
    return True


def _has_started() -> bool:
    """True if JAX has already initialised a backend."""
    bridge = sys.modules.get("jax._src.xla_bridge")
    asked = getattr(bridge, "backends_are_initialized", None)
    return bool(asked()) if asked is not None else "jax" in sys.modules
