"""The governor of a reference: its time along the path, pauses, and offsets that are taken back."""
