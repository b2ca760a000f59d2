"""Speed and accuracy of every engine next to others, on the present machine. Times are never tests."""
