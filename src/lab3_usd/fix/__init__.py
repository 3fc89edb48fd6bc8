"""Repairs stages: what is edited in which layer, and how a text layer keeps its layout."""
