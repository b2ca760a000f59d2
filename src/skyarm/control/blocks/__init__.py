"""Parts that several laws are made of."""
