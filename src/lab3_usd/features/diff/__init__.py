"""The differences between two stages."""

from lab3_usd.hooks import Command, Feature

FEATURE = Feature(
    commands={
        "diff": Command(
            "any Isaac Sim stage",
            "List the differences between two stages.",
            ("lab3 diff BEFORE.usda AFTER.usda",),
            "lab3_usd.features.diff.diff",
        ),
    },
    answers={"changes_to": "lab3_usd.features.diff.diff"},
)
