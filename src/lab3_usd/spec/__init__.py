"""What a correct stage is: platform, graph specs and checkpoints, loaded from `graphs/`."""
