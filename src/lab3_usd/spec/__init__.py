"""What a correct stage is: catalog, graph specs and checkpoints, loaded from `graphs/`."""
