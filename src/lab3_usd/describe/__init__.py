"""Describing a lab after a stage that works."""
