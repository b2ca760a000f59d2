"""Export of controllers to a flight computer as C code."""
