"""The dry run: plays a stage without Isaac Sim."""

from lab3_usd.hooks import Command, Feature

FEATURE = Feature(
    commands={
        "sim": Command(
            "any Isaac Sim stage",
            "Simulate a stage without Isaac Sim, and check its ROS messages.",
            (
                "lab3 sim STAGE.usda",
                "lab3 sim STAGE.usda --page sim.html",
            ),
            "lab3_usd.features.sim.sim",
        ),
    },
    answers={"effects_of": "lab3_usd.sim.any_stage", "with_dry_run": "lab3_usd.features.sim.notes"},
)
