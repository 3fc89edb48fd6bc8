"""Rules about the robot and the world around it."""
