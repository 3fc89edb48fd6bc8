"""The parts of the report for people on a terminal."""
