"""Plays a stage in real time, for other programs of ROS 2."""

from lab3_usd.hooks import Feature

FEATURE = Feature(
    additions={"sim": "lab3_usd.features.live.sim_live"},
)
