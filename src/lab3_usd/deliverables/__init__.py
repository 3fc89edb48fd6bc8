"""What a submission holds beside its stages: maps, Nav2 parameters, saved output."""
