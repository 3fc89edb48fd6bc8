"""Judges what came over ROS, whoever recorded it."""
