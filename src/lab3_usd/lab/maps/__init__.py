"""Occupancy maps."""
