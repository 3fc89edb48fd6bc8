"""What a dry run reads and shows, as plain data."""
