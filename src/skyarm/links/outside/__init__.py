"""Control laws that run outside of the simulator, in real time, and fly a vehicle through its autopilot."""
