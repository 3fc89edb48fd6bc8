"""Judging submissions in processes of their own."""
