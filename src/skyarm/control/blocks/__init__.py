"""Building blocks shared by several control laws."""
