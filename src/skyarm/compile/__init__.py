"""Compilation of traceable functions into straight-line programs, independent of
simulation.
"""

from skyarm.compile.tracing.program import Program, trace
from skyarm.compile.tracing.tracer import Graph, Node, TracedBranchError

__all__ = ["Graph", "Node", "Program", "TracedBranchError", "trace"]
