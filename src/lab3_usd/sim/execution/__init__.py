"""Runs graphs as they are wired: events push execution, data is pulled."""
