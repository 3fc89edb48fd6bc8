"""Grades a class, and submissions that nobody trusts."""

from lab3_usd.hooks import Command, Feature, Format

FEATURE = Feature(
    commands={
        "grade": Command(
            "graders",
            "Grade a whole class of submissions.",
            (
                "lab3 grade class --starter starter.usda -o gradebook",
                "lab3 grade class.zip --starter starter.usda -o gradebook --jobs 4",
            ),
            "lab3_usd.features.grade.grade",
        ),
    },
    formats={
        "gradescope": Format(
            "lab3_usd.report.formats.gradescope", "results of a Gradescope autograder"
        )
    },
    answers={
        "find_untrusted": "lab3_usd.grade.untrusted",
        "grade_of": "lab3_usd.grade.gradebook",
        "judge_untrusted": "lab3_usd.grade.untrusted",
        "unpacked_lab": "lab3_usd.grade.intake.archives",
    },
)
