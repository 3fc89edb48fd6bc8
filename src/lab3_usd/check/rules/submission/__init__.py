"""Rules about files: stages, maps, parameters, saved output."""
