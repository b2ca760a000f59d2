"""Control laws, one folder or file each."""
