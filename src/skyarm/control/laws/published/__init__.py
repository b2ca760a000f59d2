"""Laws of other authors, one per file: those that the paper cites, and two current standards (INDI, L1)."""
