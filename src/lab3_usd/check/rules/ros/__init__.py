"""Rules about topics and TF frames."""
