"""What is kept of an episode."""
