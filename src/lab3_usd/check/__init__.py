"""Comparing the graphs a spec asks for with the graphs a stage holds."""
