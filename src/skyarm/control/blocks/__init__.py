"""Building blocks of several laws."""
