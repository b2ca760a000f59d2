"""What a vehicle and its world look like, from their records alone: shapes, and where they are."""
