"""Many flights: what flies (work), how (fly), where (executor), and the rows that are kept of it (store)."""

from skyarm.studies.flights.executor import Crew
from skyarm.studies.flights.store import Store
from skyarm.studies.flights.work import Rows, Work

__all__ = ["Crew", "Rows", "Store", "Work"]
