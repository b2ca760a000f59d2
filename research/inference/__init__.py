"""Search for what a scenario leaves open, from numbers that were measured of its
flights.
"""
