"""Writes `graphs/isaac/early_releases.yaml`: what releases of before Isaac Sim 5.0 have otherwise.

Run `python docs/make_early_releases.py CLONE EXTENSIONS LATER`. CLONE is a git clone of
isaac-sim/IsaacSim with its tags. EXTENSIONS is one of a repository that holds the extensions of
2022.2.1, LATER of 2023.1.1: names, ports, types and defaults come from the interfaces that
OmniGraph generated there, versions from its stages and tests beside them. Of the releases between
only what `BETWEEN` says is public.
"""

from __future__ import annotations

import ast
import json
import re
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml
from make_node_types import (
    EARLIER,
    FOLDER,
    TAG,
    Types,
    _git,
    changes_of,
    node_types,
    ports_of,
    release_lines,
    type_lines,
    zero,
)

FIRST, LIKE = "2022.2", "5.0"
COMMIT = "a1c50ab78c20ca06d257918c1f22fa451fca5ea7"
SECOND, SECOND_COMMIT = "2023.1", "ec7e05da4c58df7825b82828ad10b592e3d0ed00"
# How an interface names types, beside those that OGN names so, too.
_VECTORS = re.compile(r"^(double|float|int)([234])(\[\])?$")
_ROLES = re.compile(r"^(vector|point|color|normal|matrix)([34])([dfh])(\[\])?$")
# Types that no later release has: the last one that is known to.
LAST = {
    "omni.isaac.ros_bridge.": "4.5",
    "isaacsim.sensors.rtx.": "4.5",
    "omni.isaac.examples_nodes.": "4.2",
}
CONTROLLER, PLANS = "isaacsim.robot.wheeled_robots.", "isaacsim.core.nodes."
GRIPPER = "isaacsim.robot.surface_gripper.SurfaceGripper"
CAMERA = "isaacsim.ros2.bridge.ROS2CameraHelper"
TIME, ARTICULATION = f"{PLANS}IsaacReadSimulationTime", f"{PLANS}IsaacArticulationController"
DIFFERENTIAL = f"{CONTROLLER}DifferentialController"
# What is public of the others: type, ports and tokens that they share with 2022.2.
BETWEEN: dict[str, dict[str, tuple[str, ...]]] = {
    "4.2": {
        GRIPPER: ("*",),
        CAMERA: ("inputs:type",),
        TIME: ("inputs:swhFrameNumber",),
    },
    "4.5": {GRIPPER: ("*",), TIME: ("inputs:swhFrameNumber",)},
}
# Types between of which only the names are public.
NAMED = {
    f"{PLANS}IsaacReadTimes": ("2023.1", "4.5"),  # a saved stage
    "isaacsim.sensors.rtx.IsaacPrintRTXSensorInfo": ("2023.1", "4.5"),  # the list of renames
}
BINARY = "isaacsim.util.debug_draw."  # whose nodes no release has in its public source


def interfaces(extensions: Path, commit: str) -> Types:
    """Return every node type of a release by its name, as `.ogn` files write them."""
    names = _git(extensions, "ls-tree", "-r", "--name-only", commit).splitlines()
    versions = dict(_versions(extensions, commit, names))
    found: Types = {}
    for name in names:
        if re.match(r"exts/omni\.(isaac|replicator)\..*Database\.py$", name):
            text = _git(extensions, "show", f"{commit}:{name}")
            known = re.search(r"nodes of type ([\w.]+)", text)
            if known is not None:
                kind = known[1]
                version = versions.get(kind, versions.get(kind.replace(".", "_"), 1))
                found[kind] = {"version": version, "uiName": _title(kind), **_ports(text)}
    return dict(sorted(found.items()))


def _title(kind: str) -> str:
    words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", kind.rpartition(".")[2])
    return words.replace("ROS1Publish", "ROS1 Publish").replace("ROS1Subscribe", "ROS1 Subscribe")


def _changes(entry: Mapping[str, Any], base: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a type has otherwise; a default that is not written is a zero."""
    found, ports = changes_of(entry, base), ports_of(base)
    defaults = {
        port: value
        for port, value in found.pop("defaults", {}).items()
        if ports[port].get("default") is not None or value != zero(ports[port]["type"])
    }
    return {**found, "defaults": defaults} if defaults else found


def _versions(extensions: Path, commit: str, names: list[str]) -> Iterator[tuple[str, int]]:
    """Yield the version of each type, by its name or, where a test tells, with underscores."""
    pair = re.compile(r'node:type = "([\w.]+)"\s+int node:typeVersion = (\d+)')
    tested = re.compile(r'/Template_(\w+)"\)(?:.|\n)*?type_version\(node_type_name\), (\d+)')
    for name in names:
        found = pair if name.endswith("Template.usda") else tested
        if found is pair or re.search(r"/tests/TestOgn\w+\.py$", name):
            for kind, version in found.findall(_git(extensions, "show", f"{commit}:{name}")):
                yield kind, int(version)


def _ports(text: str) -> dict[str, dict[str, Any]]:
    """Return the ports of an interface by their sides."""
    values = (node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Assign))
    interface = next(v for v in values if getattr(v.targets[0], "id", "") == "INTERFACE").value
    sides: dict[str, dict[str, Any]] = {}
    for row in interface.args[0].elts:  # type: ignore[attr-defined]
        side, _, short = str(row.elts[0].value).partition(":")
        kind, extended = str(row.elts[1].value), row.elts[2].value
        said: dict[str, Any] = {"type": kind.split(",") if extended else _ogn(kind)}
        default = ast.literal_eval(row.elts[7])
        if default is not None and not extended and kind not in {"bundle", "execution", "target"}:
            said["default"] = default
        tokens = [
            ast.literal_eval(value)
            for key, value in zip(row.elts[5].keys, row.elts[5].values, strict=True)
            if ast.unparse(key).endswith("ALLOWED_TOKENS")
        ]
        if tokens:
            said["metadata"] = {"allowedTokens": tokens[0]}
        sides.setdefault(side, {})[short] = said
    return {side: ports for side, ports in sides.items() if side in {"inputs", "outputs"}}


def _ogn(kind: str) -> str:
    """Return the OGN name of a type that an interface names as USD does."""
    role, vector = _ROLES.match(kind), _VECTORS.match(kind)
    if role is not None:
        return f"{role[1]}{role[3]}[{role[2]}]{role[4] or ''}"
    if vector is not None:
        return f"{vector[1]}[{vector[2]}]{vector[3] or ''}"
    return {"bundle": "target", "quatd": "quatd[4]"}.get(kind, kind)


def canonical(kind: str, names: Mapping[str, Any], known: Mapping[str, Any]) -> str:
    """Return the name that a type has today."""
    prefix, _, last = kind.rpartition(".")
    now = names["renamed"].get(kind, f"{names['prefixes'].get(prefix, prefix)}.{last}")
    near = [name for name in known if name.rpartition(".")[2] == last]
    return now if now in known or len(near) != 1 or "ros_bridge" in kind else near[0]


def lines(clone: Path, extensions: Path, later_ones: Path) -> Iterator[str]:
    """Yield the lines of the file."""
    now = node_types(clone, TAG)
    names = yaml.safe_load((FOLDER / "renames.yaml").read_text(encoding="utf-8"))
    later = {**node_types(clone, EARLIER[LIKE]), **now}
    types, second = (
        {canonical(kind, names, later): said for kind, said in interfaces(*each).items()}
        for each in ((extensions, COMMIT), (later_ones, SECOND_COMMIT))
    )
    gone = {
        kind: said
        for kind, said in types.items()
        if kind not in later and not kind.startswith(BINARY)
    }
    named = {kind: {"uiName": _title(kind), "is_open": True} for kind in NAMED}
    gone |= {kind: second.get(kind, said) for kind, said in named.items()}
    changed, changed_later = (
        {kind: _changes(each[kind], now[kind]) for kind in sorted(each.keys() & now)}
        for each in (types, second)
    )
    yield "# What releases of before Isaac Sim 5.0 have otherwise than 6.0.1, as in versions.yaml."
    yield f"# 2022.2: facts read off the generated interfaces of 2022.2.1 ({COMMIT[:10]} of"
    yield f"# swadaskar/Isaac_Sim_Folder), 2023.1: of 2023.1.1 ({SECOND_COMMIT[:10]} of"
    yield "# phgandhi02/isaac_sim-2023.1.1). The others: what is public, and all else `like` 5.0."
    yield "# By docs/make_early_releases.py: change that, not this."
    yield ""
    yield "gone:  # types that no release from 5.0 on has, by the first and the last that has them"
    spans: dict[tuple[str, str], list[str]] = {}
    for kind in sorted(gone):
        last = next((last for part, last in LAST.items() if kind.startswith(part)), FIRST)
        spans.setdefault(NAMED.get(kind, (FIRST, last)), []).append(kind)
    for (first, last), kinds in spans.items():
        yield f'  - since: "{first}"'
        yield f'    until: "{last}"'
        yield "    types:"
        yield from type_lines({kind: gone[kind] for kind in kinds}, "      ")
    yield ""
    yield "releases:"
    yield f'  "{FIRST}":'
    yield f"    lacks: {json.dumps(sorted(set(now) - set(types)))}"
    yield from release_lines({}, changed, "    ")
    yield f'  "{SECOND}":'
    yield f'    like: "{LIKE}"'
    yield from release_lines({}, changed_later, "    ")
    for release, shared in BETWEEN.items():
        yield f'  "{release}":'
        yield f'    like: "{LIKE}"'
        yield "    types:"
        for kind, ports in shared.items():
            yield f"      {kind}:"
            kept = _shared(changed[kind], ports)
            yield from (f"        {key}: {json.dumps(said)}" for key, said in kept.items())


def _shared(changes: Mapping[str, Any], ports: tuple[str, ...]) -> dict[str, Any]:
    """Return the part of some changes that concerns ports."""
    if "*" in ports:
        return dict(changes)
    found = {
        key: {port: changes.get(key, {})[port] for port in ports if port in changes.get(key, {})}
        for key in ("ports", "allowed")
    }
    return {key: said for key, said in found.items() if said}


if __name__ == "__main__":
    text = "\n".join(lines(*map(Path, sys.argv[1:4]))) + "\n"
    (FOLDER / "early_releases.yaml").write_text(text, encoding="utf-8")
