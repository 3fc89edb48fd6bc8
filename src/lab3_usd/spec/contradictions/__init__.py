"""What contradicts itself in the description of a lab."""
