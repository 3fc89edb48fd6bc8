"""The script that plays the stages in Isaac Sim itself."""

from lab3_usd.hooks import Command, Feature

FEATURE = Feature(
    commands={
        "play": Command(
            "students",
            "Write the script that plays the stages in Isaac Sim itself.",
            ("lab3 play -o play.py",),
            "lab3_usd.features.play.play",
        ),
    },
)
