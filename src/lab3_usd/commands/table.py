"""Which commands there are, by who uses them, and what each does."""

from __future__ import annotations

# Each command is a module that defines `command`; it is imported only when it is asked for,
# so that `lab3 --help` starts without pxr and networkx.
GROUPS = {
    "students": {
        "check": "Check stages or whole submissions against the lab.",
        "fix": "Repair what the check finds in a stage.",
        "sim": "Play a stage without Isaac Sim, and say what it does.",
        "bag": "Judge a recording of the running system.",
        "draw": "Draw Action Graphs and the TF tree.",
        "tf": "Print the TF tree that a stage publishes.",
        "topics": "Print the topics that a stage publishes and subscribes to.",
        "diff": "Say what differs between two stages, in words of the lab.",
        "map": "Make an occupancy map from the walls of a stage.",
        "nav2": "Write launch, parameter and RViz files for localization and navigation.",
        "collect": "Write the script that collects evidence from the running system.",
        "play": "Write the script that plays the stages in Isaac Sim itself.",
    },
    "graders": {"grade": "Grade a whole class of submissions."},
    "course authors": {
        "lab": "Check the description of a lab, or start one after a stage.",
        "build": "Build the stages of the checkpoints from a starter scene.",
        "starter": "Write the starter scene of the lab.",
    },
    "everyone": {
        "lint": "Judge any stage of Isaac Sim, without a spec.",
        "rules": "List all rules.",
        "rule": "Explain one rule.",
        "config": "Print which configuration is in force, and where it comes from.",
        "doctor": "Say what works on this computer.",
        "completion": "Print the shell completion script.",
    },
}
COMMANDS = {name: text for group in GROUPS.values() for name, text in group.items()}
EXAMPLES = {
    "lab3 check STAGE.usda": "check one stage",
    "lab3 check work --format html -o report.html": "check all, with pictures",
    "lab3 rule W01": "explain one rule",
}
