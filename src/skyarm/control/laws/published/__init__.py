"""Laws of other authors, each in a file of its own: what the paper cites, and two of today's standards."""
