"""Films and recordings of flights: moving scenes, cameras, rendering, files."""
