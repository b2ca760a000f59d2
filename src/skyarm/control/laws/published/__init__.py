"""Laws of other authors, each in a file of its own: those that the paper cites, and two present standards."""
