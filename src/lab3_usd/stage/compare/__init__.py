"""Comparing a stage with the starter it was made from."""
