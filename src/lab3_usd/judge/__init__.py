"""Reads a stage or a folder, has it checked, and says where the findings are."""
