"""Which commands there are, by who uses them, what each does, and calls of it."""

from __future__ import annotations

# Each command is a module that defines `command`; it is imported only when it is asked for,
# so that `lab3 --help` starts without pxr and networkx. A sentence, and the calls with which
# the help of the command ends.
GROUPS: dict[str, dict[str, tuple[str, ...]]] = {
    "any stage of Isaac Sim": {
        "lint": (
            "Judge any stage of Isaac Sim, without a lab.",
            "lab3 lint robot.usd",
            "lab3 lint scenes --isaac 5.1 --format sarif -o lint.sarif",
            "lab3 lint robot.usd --fix --diff",
        ),
        "fix": (
            "Repair the findings of lint or of a check.",
            "lab3 fix STAGE.usda --diff",
            "lab3 fix work --in-place",
        ),
        "robots": (
            "Print the robots of a stage: wheels, joints, sensors, frames.",
            "lab3 robots robot.usd",
        ),
        "add": (
            "Add ROS 2 graphs for the robots and sensors of a stage.",
            "lab3 add drive robot.usd",
            "lab3 add camera robot.usd --publish rgb --in-place",
            "lab3 add --file ros.yaml robot.usd --diff",
        ),
        "remove": ("Remove such a graph.", "lab3 remove drive robot.usd --in-place"),
        "sim": (
            "Play a stage without Isaac Sim, and judge its messages.",
            "lab3 sim STAGE.usda",
            "lab3 sim STAGE.usda --page sim.html",
        ),
        "draw": (
            "Draw Action Graphs and the TF tree.",
            "lab3 draw STAGE.usda -o pictures",
            "lab3 draw ROS_Drive -o pictures",
        ),
        "tf": (
            "Print the TF tree that a stage publishes.",
            "lab3 tf STAGE.usda -v",
            "lab3 tf STAGE.usda --graph tree.svg",
        ),
        "topics": (
            "Print the topics that a stage publishes and subscribes to.",
            "lab3 topics STAGE.usda",
        ),
        "diff": ("List the differences between two stages.", "lab3 diff BEFORE.usda AFTER.usda"),
        "bag": (
            "Judge a recording of the running system.",
            "lab3 bag run",
            "lab3 bag run --stage STAGE.usda",
        ),
        "server": (
            "Serve an editor: findings as you type, manuals, repairs.",
            "lab3 server",
        ),
        "rules": ("List all rules.", "lab3 rules", "lab3 rules --all"),
        "rule": ("Explain one rule.", "lab3 rule W01", "lab3 rule wire", "lab3 rule --all"),
    },
    "students": {
        "check": (
            "Check stages or whole submissions against the lab.",
            "lab3 check STAGE.usda",
            "lab3 check work --format html -o report.html",
            "lab3 check . --submission",
        ),
        "map": ("Make an occupancy map from the walls of a stage.", "lab3 map STAGE.usda -o maps"),
        "nav2": (
            "Write launch, parameter and RViz files for localization and navigation.",
            "lab3 nav2 -o nav2",
        ),
        "collect": (
            "Write the script that collects evidence from the running system.",
            "lab3 collect -o collect.sh",
        ),
        "play": (
            "Write the script that plays the stages in Isaac Sim itself.",
            "lab3 play -o play.py",
        ),
    },
    "graders": {
        "grade": (
            "Grade a whole class of submissions.",
            "lab3 grade class --starter starter.usda -o gradebook",
            "lab3 grade class.zip --starter starter.usda -o gradebook --jobs 4",
        ),
    },
    "course authors": {
        "lab": (
            "Check the description of a lab, or write one from its stages.",
            "lab3 lab new mylab solutions",
            "lab3 lab check mylab",
        ),
        "build": (
            "Build the stages of the checkpoints from a starter scene.",
            "lab3 build --out stages",
            "lab3 build starter.usda --out stages --through 02",
        ),
        "starter": ("Write the starter scene of the lab.", "lab3 starter -o starter.usda"),
    },
    "this installation": {
        "demo": ("Make stages to try the program on.", "lab3 demo", "lab3 demo somewhere"),
        "config": (
            "Print the effective configuration and its sources.",
            "lab3 config",
            "lab3 config STAGE.usda",
        ),
        "doctor": ("Report what works on this computer.", "lab3 doctor"),
        "completion": (
            "Print the shell completion script.",
            "lab3 completion bash",
            "lab3 completion powershell",
        ),
    },
}
COMMANDS = {name: text for group in GROUPS.values() for name, (text, *_) in group.items()}
CALLS = {name: calls for group in GROUPS.values() for name, (_, *calls) in group.items()}
EXAMPLES = {
    "lab3 lint robot.usd": "judge any stage",
    "lab3 check work --format html -o report.html": "check a folder, with pictures",
    "lab3 rule W01": "explain one rule",
}
