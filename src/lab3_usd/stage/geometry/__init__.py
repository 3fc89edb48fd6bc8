"""Where prims stand, and the shapes of their colliders."""
