"""Graphs for any stage: the robots of one, and what is added to it and removed."""

from lab3_usd.hooks import Command, Feature

FEATURE = Feature(
    commands={
        "robots": Command(
            "any Isaac Sim stage",
            "Print the robots of a stage: wheels, joints, sensors, frames.",
            ("lab3 robots robot.usd",),
            "lab3_usd.features.author.robots",
        ),
        "add": Command(
            "any Isaac Sim stage",
            "Add ROS 2 graphs for the robots and sensors of a stage.",
            (
                "lab3 add drive robot.usd",
                "lab3 add camera robot.usd --publish rgb --in-place",
                "lab3 add --file ros.yaml robot.usd --diff",
            ),
            "lab3_usd.features.author.add",
        ),
        "remove": Command(
            "any Isaac Sim stage",
            "Remove such a graph.",
            ("lab3 remove drive robot.usd --in-place",),
            "lab3_usd.features.author.remove",
        ),
    },
)
