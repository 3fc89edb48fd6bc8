"""The robot, its wheels and sensors, and the ground, as the rules ask for them."""
