"""Plants: simulated vehicles. They share rotors, wind and joint friction, and no rigid-body code."""
