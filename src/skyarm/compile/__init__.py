"""From functions over scalars to programs: tracing, then straight-line code. Knows nothing of flying."""

from skyarm.compile.program import Program, trace
from skyarm.compile.records import leaves, rebuild, shaped_like
from skyarm.compile.tracer import Graph, Node, TracedBranchError

__all__ = ["Graph", "Node", "Program", "TracedBranchError", "leaves", "rebuild", "shaped_like", "trace"]
