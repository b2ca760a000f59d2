"""Threads of the linear algebra: matrices of a loop are small, and its threads would only wait for one another."""

from __future__ import annotations

from skyarm.compile.machine_code import missing_extra

try:
    from threadpoolctl import threadpool_limits
except ImportError as error:  # pragma: no cover  (the library is there when this is tested)
    raise missing_extra("tune") from error

__all__ = ["threadpool_limits"]
