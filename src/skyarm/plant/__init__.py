"""Plants: what is simulated. They share rotors, wind and joint friction, and no rigid-body code."""
