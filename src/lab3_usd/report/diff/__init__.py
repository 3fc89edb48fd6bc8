"""What differs between two stages, as text and JSON."""
