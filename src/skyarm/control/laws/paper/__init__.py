"""The paper's law, its baseline and the controller that RotorS ships."""
