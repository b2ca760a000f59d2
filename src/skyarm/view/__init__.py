"""Pictures of flights: one scene, drawn as figures, films, recordings and on the live page."""
