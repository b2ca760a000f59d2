"""Records: walk, name, check, digest and write a frozen record of numbers, and read it back."""
