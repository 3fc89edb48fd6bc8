"""Bodies, joints and wheels: exact kinematics, no forces."""
