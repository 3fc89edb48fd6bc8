"""What a turning beam sees of the visible shapes."""
