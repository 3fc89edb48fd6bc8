"""The gradebook and the reports of each student."""
