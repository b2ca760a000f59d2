"""Laws of the paper that also press on a surface, as others do it: rivals of the centroidal law's interaction."""
