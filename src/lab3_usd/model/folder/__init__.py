"""What the rules about a folder look at, as plain data."""
