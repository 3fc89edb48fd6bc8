"""What each node type computes, after the source of Isaac Sim 6.0.1."""
