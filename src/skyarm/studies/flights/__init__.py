"""Simulation of many flights: work items, their simulation, parallel execution, and
stored results.
"""

from skyarm.studies.flights.executor import WorkRunner
from skyarm.studies.flights.store import Store
from skyarm.studies.flights.work import Rows, Work

__all__ = ["Rows", "Store", "Work", "WorkRunner"]
