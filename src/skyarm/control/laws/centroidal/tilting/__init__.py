"""Part of the centroidal law for rotors that push sideways; the law itself does not import it."""
