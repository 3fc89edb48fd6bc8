"""Judges ROS messages, of a dry run or a recording."""
