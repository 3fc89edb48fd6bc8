"""Descriptions of labs: checked, and written after stages."""

from lab3_usd.hooks import Command, Feature

FEATURE = Feature(
    commands={
        "lab": Command(
            "course authors",
            "Check the description of a lab, or write one from its stages.",
            ("lab3 lab new mylab solutions", "lab3 lab check mylab"),
            "lab3_usd.features.new_lab.lab",
        ),
    },
)
