"""What works on this computer."""

from lab3_usd.hooks import Command, Feature

FEATURE = Feature(
    commands={
        "doctor": Command(
            "this installation",
            "Report what works on this computer.",
            ("lab3 doctor",),
            "lab3_usd.features.doctor.doctor",
        ),
    }
)
