"""Parts of the centroidal law for a tip that touches: pressing, giving way, carrying; the law itself imports none."""
