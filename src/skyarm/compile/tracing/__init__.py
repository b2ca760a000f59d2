"""From a traceable function to a straight-line program."""
