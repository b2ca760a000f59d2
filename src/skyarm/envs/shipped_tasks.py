"""Tables of the shipped environments, from which they are registered and made."""

from skyarm.records.files import shipped_tables

TASKS = shipped_tables(__file__)
"""Table of each shipped environment by its name between ``skyarm/`` and ``-v0``."""
