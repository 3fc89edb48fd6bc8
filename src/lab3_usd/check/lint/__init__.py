"""Judging any stage of Isaac Sim by what its nodes do, without a spec."""
