"""Edits the layers of an open stage."""
