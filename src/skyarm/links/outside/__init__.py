"""Control laws that run outside the simulator, in real time, and fly a vehicle through
its autopilot.
"""
