"""Optional sideways force of the centroidal law, for rotors that can push across body
z.
"""
