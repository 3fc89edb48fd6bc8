"""Files for localization and navigation."""

from lab3_usd.hooks import Command, Feature

FEATURE = Feature(
    commands={
        "map": Command(
            "students",
            "Make an occupancy map from the walls of a stage.",
            ("lab3 map STAGE.usda -o maps",),
            "lab3_usd.features.navigation.map",
        ),
        "nav2": Command(
            "students",
            "Write launch, parameter and RViz files for localization and navigation.",
            ("lab3 nav2 -o nav2",),
            "lab3_usd.features.navigation.nav2",
        ),
    },
)
