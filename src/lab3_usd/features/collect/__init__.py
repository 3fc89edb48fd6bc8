"""The script that collects evidence from the running system."""

from lab3_usd.hooks import Command, Feature

FEATURE = Feature(
    commands={
        "collect": Command(
            "students",
            "Write the script that collects evidence from the running system.",
            ("lab3 collect -o collect.sh",),
            "lab3_usd.features.collect.collect",
        ),
    },
)
