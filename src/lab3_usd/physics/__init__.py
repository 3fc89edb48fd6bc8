"""Bodies, joints, wheels and shapes of a scene: what carries a robot, and exact kinematics."""
