"""Part of the centroidal law for rotors that push sideways; the law itself names none."""
