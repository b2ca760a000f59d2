"""Model predictive control of the whole vehicle: prediction, cost, observer and
solver.
"""
