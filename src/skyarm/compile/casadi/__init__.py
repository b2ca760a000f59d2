"""CasADi functions of a traced program."""
