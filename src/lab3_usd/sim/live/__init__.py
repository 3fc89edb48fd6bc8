"""A dry run that other programs of ROS 2 hear and drive, over DDS."""
