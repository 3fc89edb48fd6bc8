"""Writes `graphs/isaac/kit_types.yaml`: what is seen of Kit's own node types, which are not public.

Run `python docs/make_kit_types.py CLONE STAGES`, where CLONE is a git clone of isaac-sim/IsaacSim
with its tags and STAGES a folder of saved stages. Ports are those that saved nodes declare, and
those that NVIDIA's own scripts set and connect; nothing else is known of a type.
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

from msgspec import Struct
from pxr import Sdf

from lab3_usd.isaac.platform import Platform
from lab3_usd.spec.load.loader import load_platform

FILE = Path(__file__).resolve().parents[1] / "graphs" / "isaac" / "kit_types.yaml"
TAG = "v6.0.1"
# Types whose names tell that of their value, which is drawn as an output.
_CONSTANT = "Constant"
_VALUES = ("bool", "double", "float", "half", "int", "int64", "string", "token", "uint", "uint64")
_LEFT_OUT = ("omni.graph.scriptnode.",)  # whose ports their scripts make


class Seen(Struct):
    """Where a type was seen: how many saved nodes, in how many stages, in how many scripts."""

    nodes: int
    version: int
    stages: set[str]
    scripts: set[str]
    ports: dict[str, bool]  # whether it carries a signal


def main(clone: Path, stages: Path) -> None:
    """Write the file."""
    catalog = load_platform()
    public = {name for name, kind in catalog.types.items() if not kind.is_open}
    seen: dict[str, Seen] = defaultdict(lambda: Seen(0, 1, set(), set(), {}))
    for path in sorted(stages.rglob("*.usd*")):
        _look_at_stage(path, seen)
    for name, script in _scripts(clone):
        _look_at_script(name, script, catalog, seen)
    kit = {
        name: found
        for name, found in sorted(seen.items())
        if name.startswith("omni.graph.") and name not in public and found.ports
        if not name.startswith(_LEFT_OUT)
    }
    FILE.write_text("\n".join(_lines(kit)) + "\n")
    sys.stdout.write(f"{len(kit)} node types\n")


def _look_at_stage(path: Path, seen: dict[str, Seen]) -> None:
    layer = Sdf.Layer.FindOrOpen(str(path))

    def visit(where: Sdf.Path) -> None:
        prim = layer.GetPrimAtPath(where)
        kind = prim.attributes.get("node:type") if prim else None
        if kind is None or not kind.default:
            return
        found = seen[kind.default]
        version = prim.attributes.get("node:typeVersion")
        found.version = max(found.version, version.default if version else 1)
        found.nodes += 1
        found.stages.add(path.name)
        for port in prim.properties:
            if port.name.startswith(("inputs:", "outputs:")):
                is_signal = bool(port.customData.get("isExecution")) or _sounds_so(port.name)
                found.ports[port.name] = found.ports.get(port.name, False) or is_signal

    layer.Traverse(Sdf.Path.absoluteRootPath, visit)


def _sounds_so(port: str) -> bool:
    return port.partition(":")[2].startswith("exec")


def _scripts(clone: Path) -> Iterator[tuple[str, str]]:
    def git(*arguments: str) -> str:
        command = ["git", "-C", str(clone), *arguments]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout

    for name in git("grep", "-l", "-F", '"omni.graph.', TAG, "--", "*.py").split():
        yield name, git("show", name)


def _look_at_script(name: str, script: str, catalog: Platform, seen: dict[str, Seen]) -> None:
    """Take the ports that a script names of nodes whose type it tells without doubt."""
    types: dict[str, set[str]] = defaultdict(set)
    for node, kind in re.findall(r'\(\s*[fr]?"([\w/{}]+)"\s*,\s*"([\w.]+)"\s*,?\s*\)', script):
        types[node].add(kind)
    certain = {node: next(iter(kinds)) for node, kinds in types.items() if len(kinds) == 1}
    ports = re.compile(r"([\w/{}]+)\.((?:inputs|outputs):\w+)")
    for node, port in ports.findall(script):
        kind = certain.get(node.rpartition("/")[2], "")
        if kind.startswith("omni.graph."):
            seen[kind].scripts.add(name)
            seen[kind].ports.setdefault(port, _sounds_so(port))
    wire = re.compile(rf'"{ports.pattern}"\s*,\s*[fr]?"{ports.pattern}"')
    for source, out, target, into in wire.findall(script):
        for node, port, other, far in ((source, out, target, into), (target, into, source, out)):
            kind, end = (certain.get(name.rpartition("/")[2], "") for name in (node, other))
            known = catalog.types[end].ports.get(far) if end in catalog.types else None
            if kind in seen and (_sounds_so(far) or (known is not None and known.is_execution)):
                seen[kind].ports[port] = True


def _lines(kit: dict[str, Seen]) -> Iterator[str]:
    yield "# What is seen of node types of Kit, whose source is not public: ports that saved nodes"
    yield "# declare, and that NVIDIA's scripts (isaac-sim/IsaacSim v6.0.1, Apache-2.0) set and"
    yield "# connect. Facts read off by docs/make_kit_types.py: change that, not this."
    yield "# Each type may have more ports, and whether a signal goes on is not known."
    yield ""
    yield "types:"
    for name, found in kit.items():
        title = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", name.rpartition(".")[2])
        nodes = f"{found.nodes} nodes in {len(found.stages)} saved stages"
        yield f"  {name}:  # {nodes}, {len(found.scripts)} scripts"
        yield f"    version: {found.version}"
        yield f'    name: "{title}"'
        yield f"    prim: {title.lower().replace(' ', '_')}"
        yield "    is_open: true"
        for side in ("inputs", "outputs"):
            ports = sorted(port for port in found.ports if port.startswith(side))
            if ports:
                yield f"    {side}:"
            for port in ports:
                yield f"      {port.partition(':')[2]}: {_port(name, port, found)}"


def _port(name: str, port: str, found: Seen) -> str:
    kind = name.rpartition(".")[2]
    value = kind.removeprefix(_CONSTANT).lower()
    if kind.startswith(_CONSTANT) and value in _VALUES and port == "inputs:value":
        return f"{{type: {value}, output_only: true}}"
    return "execution" if found.ports[port] else "union"


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
