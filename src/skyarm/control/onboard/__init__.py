"""Controllers for a flight computer: C code and what it needs."""
