"""How pictures come about: rows and boxes, places, ways for wires, and the ink of an SVG."""
