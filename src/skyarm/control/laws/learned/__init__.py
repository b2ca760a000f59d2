"""Learned compensator: the law of Barakou et al. 2026 with a small network that
estimates unmodelled forces.
"""
