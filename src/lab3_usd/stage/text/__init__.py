"""The text of layers: at which line something is written, and the notes in it."""
