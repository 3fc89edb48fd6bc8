"""Reads the files of `graphs/isaac/`, and those in which a lab adds to them."""
