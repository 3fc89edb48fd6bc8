"""Adds Action Graphs for ROS 2 to any stage, and removes them again."""
