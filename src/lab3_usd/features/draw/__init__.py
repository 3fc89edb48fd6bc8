"""Pictures, trees and tables of one stage."""

from lab3_usd.hooks import Command, Feature

FEATURE = Feature(
    commands={
        "draw": Command(
            "any Isaac Sim stage",
            "Draw Action Graphs and the TF tree.",
            ("lab3 draw STAGE.usda -o pictures", "lab3 draw ROS_Drive -o pictures"),
            "lab3_usd.features.draw.draw",
        ),
        "tf": Command(
            "any Isaac Sim stage",
            "Print the TF tree that a stage publishes.",
            ("lab3 tf STAGE.usda -v", "lab3 tf STAGE.usda --graph tree.svg"),
            "lab3_usd.features.draw.tf",
        ),
        "topics": Command(
            "any Isaac Sim stage",
            "Print the topics that a stage publishes and subscribes to.",
            ("lab3 topics STAGE.usda",),
            "lab3_usd.features.draw.topics",
        ),
    },
)
