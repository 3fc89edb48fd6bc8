"""What the commands share: their options, and the steps of those that judge stages."""
