"""Flight logs, their files and metrics."""
