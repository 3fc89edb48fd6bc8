"""A picture as plain data, where its boxes and wires go, and the file formats it is drawn in."""
