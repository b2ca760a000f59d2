"""The paper's computed torque made better one step at a time."""
