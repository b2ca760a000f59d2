"""What a vehicle looks like, from its records alone: shapes, and where they are."""
