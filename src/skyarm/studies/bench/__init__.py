"""How fast and how exact every engine is, side by side with others, on the machine at hand. Times are never tests."""
