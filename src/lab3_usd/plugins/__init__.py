"""Adapters that make other validators run the linter."""
