"""Files of a lab's folder that nothing reads."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.spec.lab import Lab
from lab3_usd.spec.lint.fault import LabFault
from lab3_usd.spec.lint.graph_names import file_of
from lab3_usd.spec.lint.rubric import RUBRIC_FILE
from lab3_usd.spec.load.catalog import FILE as CATALOG
from lab3_usd.spec.load.checkpoints import FILE as CHECKPOINTS
from lab3_usd.spec.load.ros import FILE as ROS
from lab3_usd.spec.load.submission import FILE as SUBMISSION
from lab3_usd.spec.scene import SCENE_FILE
from lab3_usd.spec.starter import STARTER_FILE

_FIXED = (CATALOG, CHECKPOINTS, ROS, RUBRIC_FILE, SCENE_FILE, STARTER_FILE, SUBMISSION)


def unused_files(lab: Lab) -> Iterator[LabFault]:
    """Yield the YAML files that no checkpoint asks for."""
    used = {*_FIXED, *(file_of(graph) for graph in lab.graphs.values())}
    for path in sorted(lab.folder.glob("*.yaml")):
        if path.name not in used:
            message = "no checkpoint adds this graph"
            yield LabFault(path.name, "graph", message, f"{CHECKPOINTS}: checkpoints", "warning")
