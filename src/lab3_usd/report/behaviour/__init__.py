"""What a dry run shows, for people and programs."""
