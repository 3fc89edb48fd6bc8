"""Writes a first description of a lab from stages that work."""
