"""Opening stages, and reading them into plain data."""
