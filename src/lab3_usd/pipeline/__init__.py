"""Judges the stages and folders that a path names, and finds the lines of the findings."""
