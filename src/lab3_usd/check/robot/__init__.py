"""The robot, its wheels, sensors and ground, as rules of the lab and of lint ask for them."""
