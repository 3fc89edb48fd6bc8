"""Compares two stages in words of the lab."""
