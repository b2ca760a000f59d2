"""A learned compensator: a small network that estimates what the model lacks, around the paper's law."""
