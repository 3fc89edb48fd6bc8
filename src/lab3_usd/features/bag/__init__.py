"""Recordings: judged, handed in, and made of dry runs."""

from lab3_usd.hooks import Command, Feature

FEATURE = Feature(
    commands={
        "bag": Command(
            "any Isaac Sim stage",
            "Check a recording of the running system.",
            (
                "lab3 bag run",
                "lab3 bag run --stage STAGE.usda",
            ),
            "lab3_usd.features.bag.bag",
        ),
    },
    additions={"sim": "lab3_usd.features.bag.sim_recording"},
    answers={"read_recordings": "lab3_usd.sim.bag.submitted"},
)
