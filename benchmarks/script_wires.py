"""Passes the wires that NVIDIA's own scripts write literally through the rules K21 and K22.

Usage: python benchmarks/script_wires.py CLONE

CLONE is a git clone of isaac-sim/IsaacSim with its tags. Of each script that makes a graph, the
nodes and wires that stand there as literals are laid into a stage, which is judged by the release
of the script. Fails on an error. Nothing of the scripts is kept.
"""

from __future__ import annotations

import argparse
import ast
import subprocess
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path

from msgspec import Struct
from pxr import Sdf, Usd

from lab3_usd.check.lint import lint
from lab3_usd.check.match.rule_inputs import LintSubject
from lab3_usd.model.finding import Finding
from lab3_usd.pipeline.any_stage import lint_platform
from lab3_usd.stage.read.stage_reader import read_model

TAGS = {"5.0": "v5.0.0", "5.1": "v5.1.0", "6.0": "v6.0.1"}
RULES = ("K21", "K22")


class Wire(Struct, frozen=True):
    """A wire between two ports, each with the type of its node."""

    source_type: str
    source: str
    target_type: str
    target: str

    @property
    def ends(self) -> tuple[str, str]:
        """Both ports, each behind the last name of its node's type."""
        kinds = (self.source_type, self.target_type)
        source, target = (kind.rpartition(".")[2] for kind in kinds)
        return f"{source}.{self.source}", f"{target}.{self.target}"


def main(clone: Path) -> int:
    """Print what the rules say of each release, and return 1 where an error is among it."""
    errors = 0
    for release, tag in TAGS.items():
        scripts = list(_scripts(clone, tag))
        wires = Counter(wire for script in scripts for wire in literal_wires(script))
        unnamed = sum(not (wire.source_type and wire.target_type) for wire in wires.elements())
        judged = {wire: number for wire, number in wires.items() if _is_known(wire, release)}
        print(
            f"{tag}: {wires.total()} wires in {len(scripts)} scripts, {unnamed} to nodes that are "
            f"not literal; {sum(judged.values())} between known types, {len(judged)} different"
        )
        for wire, finding in judge(list(judged), release):
            errors += finding.severity == "error"
            print(
                f"  {finding.severity} {finding.rule} {' -> '.join(wire.ends)}: {finding.message}"
            )
    print(f"{errors} errors")
    return int(errors > 0)


def _scripts(clone: Path, tag: str) -> Iterator[ast.Module]:
    listing = _git(clone, "grep", "-l", "-E", r"\bCONNECT\b", tag, "--", "*.py")
    for line in listing.splitlines():
        yield ast.parse(_git(clone, "show", line))


def _git(clone: Path, *arguments: str) -> str:
    command = ["git", "-C", str(clone), *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def literal_wires(script: ast.Module) -> Iterator[Wire]:
    """Yield the wires of a script; the type of a node is '' where the script does not tell it.

    A function has its own nodes; a name that it does not tell is looked for in the whole script.
    """
    everywhere = _types(script)
    for scope in _scopes(script):
        here = _types(*scope)
        for first, second in _pairs(*scope):
            source, target = _port(first), _port(second)
            if source and target:
                source_type, target_type = (
                    _only(here.get(name) or everywhere.get(name, set()))
                    for name in (source[0], target[0])
                )
                yield Wire(source_type, source[1], target_type, target[1])


def _scopes(script: ast.Module) -> Iterator[list[ast.AST]]:
    """Yield each function of a script, and what stands outside of all."""
    outside: list[ast.AST] = []
    ahead: list[ast.AST] = [script]
    while ahead:
        for node in ast.iter_child_nodes(ahead.pop()):
            if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
                yield [node]
            elif isinstance(node, (ast.ClassDef, ast.If, ast.With, ast.Try, ast.For, ast.While)):
                ahead.append(node)
            else:
                outside.append(node)
    yield outside


def _types(*scope: ast.AST) -> dict[str, set[str]]:
    """Return the types that a scope tells of its nodes, by name."""
    types: dict[str, set[str]] = defaultdict(set)
    for name, kind in _pairs(*scope):
        if ":" not in kind and kind.count(".") > 1:
            types[name.rpartition("/")[2]].add(kind)
    return types


def _pairs(*scope: ast.AST) -> Iterator[tuple[str, str]]:
    """Yield the pairs of texts in a scope; of a text that is put together, its last part."""
    for node in (inner for outer in scope for inner in ast.walk(outer)):
        if isinstance(node, ast.Tuple) and len(node.elts) == 2:  # noqa: PLR2004 - a pair
            first, second = (_text(element) for element in node.elts)
            if first and second:
                yield first, second


def _text(node: ast.expr) -> str:
    if isinstance(node, ast.Constant):
        return node.value if isinstance(node.value, str) else ""
    last = node.right if isinstance(node, ast.BinOp) else None
    last = node.values[-1] if isinstance(node, ast.JoinedStr) and node.values else last
    text = "" if last is None else _text(last)
    return text if text.startswith("/") else ""  # what stands before is a path then


def _port(text: str) -> tuple[str, str] | None:
    path, _, port = text.rpartition(".")
    is_port = port.startswith(("inputs:", "outputs:"))
    return (path.rpartition("/")[2], port) if is_port else None


def _only(types: set[str]) -> str:
    return next(iter(types)) if len(types) == 1 else ""


def _is_known(wire: Wire, release: str) -> bool:
    platform = lint_platform(release)
    return bool(platform.get(wire.source_type) and platform.get(wire.target_type))


def judge(wires: list[Wire], release: str) -> Iterator[tuple[Wire, Finding]]:
    """Yield what the rules say of each wire, in a graph of its own."""
    stage = Usd.Stage.CreateInMemory()
    for number, wire in enumerate(wires):
        graph = f"/Graph_{number}"
        stage.DefinePrim(graph, "OmniGraph")
        source = _node(stage, f"{graph}/source", wire.source_type, wire.source)
        target = _node(stage, f"{graph}/target", wire.target_type, wire.target)
        target.AddConnection(source.GetPath())
    platform = lint_platform(release)
    model = read_model(stage, platform, "stage.usda")
    results = lint(LintSubject(model))
    for finding in results.findings:
        if finding.rule in RULES:
            number = int(finding.prim.split("/")[1].removeprefix("Graph_"))
            yield wires[number], finding


def _node(stage: Usd.Stage, path: str, node_type: str, port: str) -> Usd.Attribute:
    prim = stage.DefinePrim(path, "OmniGraphNode")
    prim.CreateAttribute("node:type", Sdf.ValueTypeNames.Token, custom=False).Set(node_type)
    return prim.CreateAttribute(port, Sdf.ValueTypeNames.Token)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Judge the wires in NVIDIA's own scripts.")
    parser.add_argument("clone", type=Path, help="a git clone of isaac-sim/IsaacSim with its tags")
    sys.exit(main(parser.parse_args().clone))
