"""Studies of many flights: sweeps, comparisons, gains, identification, margins, assessment."""
