"""Runs graphs as they are wired, in a world with time, commands and a ROS network."""
