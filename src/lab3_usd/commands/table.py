"""Which commands there are, by who uses them, what each does, and calls of it."""

from __future__ import annotations

from typing import get_args

from lab3_usd.hooks import Command, Users, features

# A module is imported only when its command is asked for, so that `lab3 --help` starts without pxr
# and networkx. Calls are what the help of the command ends with.
_OF_THE_CORE: dict[str, Command] = {
    "lint": Command(
        "any Isaac Sim stage",
        "Check any Isaac Sim stage, or script that builds graphs.",
        (
            "lab3 lint robot.usd",
            "lab3 lint scenes --isaac 5.1 --format sarif -o lint.sarif",
            "lab3 lint robot.usd --fix --diff",
        ),
        "lab3_usd.commands.lint",
    ),
    "fix": Command(
        "any Isaac Sim stage",
        "Repair the findings of lint or of a check.",
        ("lab3 fix STAGE.usda --diff", "lab3 fix work --in-place"),
        "lab3_usd.commands.fix",
    ),
    "rules": Command(
        "any Isaac Sim stage",
        "List all rules.",
        ("lab3 rules", "lab3 rules --all"),
        "lab3_usd.commands.rules",
    ),
    "rule": Command(
        "any Isaac Sim stage",
        "Explain one rule.",
        ("lab3 rule W01", "lab3 rule wire", "lab3 rule --all"),
        "lab3_usd.commands.rule",
    ),
    "check": Command(
        "students",
        "Check stages or whole submissions against the lab.",
        (
            "lab3 check STAGE.usda",
            "lab3 check work --format html -o report.html",
            "lab3 check . --submission",
        ),
        "lab3_usd.commands.check",
    ),
    "build": Command(
        "course authors",
        "Build the stages of the checkpoints from a starter scene.",
        ("lab3 build --output stages", "lab3 build starter.usda --output stages --through 02"),
        "lab3_usd.commands.build",
    ),
    "starter": Command(
        "course authors",
        "Write the starter scene of the lab.",
        ("lab3 starter -o starter.usda",),
        "lab3_usd.commands.starter",
    ),
    "demo": Command(
        "this installation",
        "Write example stages to try the program with.",
        ("lab3 demo", "lab3 demo somewhere"),
        "lab3_usd.commands.demo",
    ),
    "config": Command(
        "this installation",
        "Print the effective configuration and its sources.",
        ("lab3 config", "lab3 config STAGE.usda"),
        "lab3_usd.commands.config",
    ),
    "completion": Command(
        "this installation",
        "Print the shell completion script.",
        ("lab3 completion bash", "lab3 completion powershell"),
        "lab3_usd.commands.completion",
    ),
}
EXAMPLES = {
    "lab3 lint robot.usd": "check any stage",
    "lab3 check work --format html -o report.html": "check a folder, with pictures",
    "lab3 rule W01": "explain one rule",
}


FORMER = {"play": "record"}  # names of commands that are still understood


def command_named(name: str) -> Command | None:
    """Return a command; a feature is imported only if it is not one of the core."""
    return _OF_THE_CORE.get(name) or all_commands().get(name)


def all_commands() -> dict[str, Command]:
    """Return every command by its name, by who uses it."""
    modules = dict(_OF_THE_CORE)
    for feature in features():
        modules |= feature.commands
    users: tuple[Users, ...] = get_args(Users)
    return dict(sorted(modules.items(), key=lambda item: users.index(item[1].users)))
