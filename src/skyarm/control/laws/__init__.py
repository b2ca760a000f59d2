"""Control laws, one file or folder each."""
