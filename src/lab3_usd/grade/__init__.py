"""Grading a whole class of submissions."""
