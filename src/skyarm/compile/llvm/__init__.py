"""Machine code of a traced program, by LLVM."""
