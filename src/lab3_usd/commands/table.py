"""Which commands there are, by who uses them, and what each does."""

from __future__ import annotations

# Each command is a module that defines `command`; it is imported only when it is asked for,
# so that `lab3 --help` starts without pxr and networkx.
GROUPS = {
    "any stage of Isaac Sim": {
        "lint": "Judge any stage of Isaac Sim, without a lab.",
        "fix": "Repair the findings of lint or of a check.",
        "sim": "Play a stage without Isaac Sim, and judge its messages.",
        "draw": "Draw Action Graphs and the TF tree.",
        "tf": "Print the TF tree that a stage publishes.",
        "topics": "Print the topics that a stage publishes and subscribes to.",
        "diff": "List the differences between two stages.",
        "bag": "Judge a recording of the running system.",
        "rules": "List all rules.",
        "rule": "Explain one rule.",
    },
    "students": {
        "check": "Check stages or whole submissions against the lab.",
        "map": "Make an occupancy map from the walls of a stage.",
        "nav2": "Write launch, parameter and RViz files for localization and navigation.",
        "collect": "Write the script that collects evidence from the running system.",
        "play": "Write the script that plays the stages in Isaac Sim itself.",
    },
    "graders": {"grade": "Grade a whole class of submissions."},
    "course authors": {
        "lab": "Check the description of a lab, or write one from its stages.",
        "build": "Build the stages of the checkpoints from a starter scene.",
        "starter": "Write the starter scene of the lab.",
    },
    "this installation": {
        "demo": "Make stages to try the program on.",
        "config": "Print the effective configuration and its sources.",
        "doctor": "Report what works on this computer.",
        "completion": "Print the shell completion script.",
    },
}
COMMANDS = {name: text for group in GROUPS.values() for name, text in group.items()}
EXAMPLES = {
    "lab3 lint robot.usd": "judge any stage",
    "lab3 check work --format html -o report.html": "check a folder, with pictures",
    "lab3 rule W01": "explain one rule",
}
# What the help of each command ends with.
CALLS = {
    "check": (
        "lab3 check STAGE.usda",
        "lab3 check work --format html -o report.html",
        "lab3 check . --submission",
    ),
    "fix": ("lab3 fix STAGE.usda --diff", "lab3 fix work --in-place"),
    "sim": (
        "lab3 sim STAGE.usda",
        "lab3 sim STAGE.usda --page sim.html",
    ),
    "bag": ("lab3 bag run", "lab3 bag run --stage STAGE.usda"),
    "draw": (
        "lab3 draw STAGE.usda -o pictures",
        "lab3 draw ROS_Drive -o pictures",
    ),
    "tf": (
        "lab3 tf STAGE.usda -v",
        "lab3 tf STAGE.usda --graph tree.svg",
    ),
    "topics": ("lab3 topics STAGE.usda",),
    "diff": ("lab3 diff BEFORE.usda AFTER.usda",),
    "map": ("lab3 map STAGE.usda -o maps",),
    "nav2": ("lab3 nav2 -o nav2",),
    "collect": ("lab3 collect -o collect.sh",),
    "play": ("lab3 play -o play.py",),
    "grade": (
        "lab3 grade class --starter starter.usda -o gradebook",
        "lab3 grade class.zip --starter starter.usda -o gradebook --jobs 4",
    ),
    "lab": ("lab3 lab new mylab solutions", "lab3 lab check mylab"),
    "build": ("lab3 build --out stages", "lab3 build starter.usda --out stages --through 02"),
    "starter": ("lab3 starter -o starter.usda",),
    "demo": ("lab3 demo", "lab3 demo somewhere"),
    "lint": (
        "lab3 lint robot.usd",
        "lab3 lint scenes --isaac 5.1 --format sarif -o lint.sarif",
        "lab3 lint robot.usd --fix --diff",
    ),
    "rules": ("lab3 rules", "lab3 rules --all"),
    "rule": ("lab3 rule W01", "lab3 rule wire", "lab3 rule --all"),
    "config": ("lab3 config", "lab3 config STAGE.usda"),
    "doctor": ("lab3 doctor",),
    "completion": ("lab3 completion bash", "lab3 completion powershell"),
}
