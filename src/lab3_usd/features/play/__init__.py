"""The script that plays the stages in Isaac Sim itself."""

from lab3_usd.hooks import Command, Feature

FEATURE = Feature(
    commands={
        "record": Command(
            "students",
            "Write a script that records the stages in Isaac Sim itself.",
            ("lab3 record -o play.py",),
            "lab3_usd.features.play.play",
        ),
    },
)
