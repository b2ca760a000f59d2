"""System identification: vehicles from logs of flights, by windows of them that the engine flies under the commands."""
