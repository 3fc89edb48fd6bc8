"""Shapes as triangles, and what a plane cuts out of them."""
