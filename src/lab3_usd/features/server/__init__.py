"""The language server for editors."""

from lab3_usd.hooks import Command, Feature

FEATURE = Feature(
    commands={
        "server": Command(
            "any Isaac Sim stage",
            "Serve an editor: findings as you type, manuals, repairs.",
            ("lab3 server",),
            "lab3_usd.features.server.server",
        ),
    },
)
