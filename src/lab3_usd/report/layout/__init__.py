"""Where the boxes and wires of a picture go."""
