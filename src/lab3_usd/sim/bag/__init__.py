"""A run as a recording that ROS 2 tools open."""
