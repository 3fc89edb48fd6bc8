"""Writing stages: the starter, graphs, sensors, checkpoints."""
