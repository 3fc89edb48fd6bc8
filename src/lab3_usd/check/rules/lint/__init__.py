"""Rules that need no spec: what is wrong with any stage of Isaac Sim."""
