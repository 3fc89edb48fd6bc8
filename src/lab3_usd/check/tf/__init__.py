"""The TF frames that a stage publishes."""
