"""Reads the graphs that Python scripts and notebooks build, without running them."""
