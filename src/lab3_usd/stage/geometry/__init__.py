"""Cuts through the collision shapes of a stage."""
