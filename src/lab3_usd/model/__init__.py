"""Plain data that all rooms share: a stage, findings, changes."""
