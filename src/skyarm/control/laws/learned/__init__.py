"""A learned compensator: a small network that tells what the model leaves out, around the paper's law."""
