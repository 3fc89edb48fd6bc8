"""What the nodes of a stage do in ROS 2: what runs, topics, quality of service."""
