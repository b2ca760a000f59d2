"""Optional contact parts of the centroidal law: force control, admittance, load
estimate.

The law itself imports none of them.
"""
