"""Films and recordings of flights: what moves, cameras, pictures of it, and the files that keep them."""
