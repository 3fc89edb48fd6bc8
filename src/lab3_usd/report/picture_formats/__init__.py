"""The file formats of a picture: one module each, SVG in four."""
