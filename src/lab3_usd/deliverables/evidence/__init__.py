"""The saved output of the running robot."""
