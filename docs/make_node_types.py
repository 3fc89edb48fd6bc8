"""Writes the files of `graphs/isaac/` that hold facts of Isaac Sim's public source.

Run `python docs/make_node_types.py CLONE`, where CLONE is a git clone of isaac-sim/IsaacSim with
its tags. Names, ports, types, defaults and tokens come from the `.ogn` files, and nothing else.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import Any

FOLDER = Path(__file__).resolve().parents[1] / "graphs" / "isaac"
TAG = "v6.0.1"
EARLIER = {"5.0": "v5.0.0", "5.1": "v5.1.0"}
SIDES = ("inputs", "outputs")
SOURCE = "Facts read off the .ogn files of isaac-sim/IsaacSim {tags} (Apache-2.0)"
_MODULE = re.compile(r"source/\w+/isaacsim\.[^/]+/.*\.ogn$")
# How the application declares OGN types in a file, where graphs/node_types.yaml does not say it.
USD_TYPES = {
    "double[2]": "double2",
    "double[3]": "double3",
    "colorf[4]": "color4f",
    "matrixd[4]": "matrix4d",
    "path": "string",
}
RENAMES = "source/extensions/isaacsim.core.deprecation_manager/config/extension.toml"
_RENAME = re.compile(r'deprecated = "([^"]+)", new = "([^"]+)"')
ZEROS = {
    **dict.fromkeys(("uchar", "int", "uint", "int64", "uint64"), 0),
    **dict.fromkeys(("float", "double"), 0.0),
    **dict.fromkeys(("string", "token", "path"), ""),
    "bool": False,
}
Types = dict[str, dict[str, Any]]


def node_types(clone: Path, tag: str) -> Types:
    """Return every node type of a release by name, as its `.ogn` file says it."""
    found: Types = {}
    for path, content in _ogn_files(clone, tag):
        for key, entry in json.loads(content).items():
            if key.startswith("$"):
                continue
            found[key if "." in key else f"{_extension(path)}.{key}"] = entry
    return dict(sorted(found.items()))


def _ogn_files(clone: Path, tag: str) -> Iterator[tuple[str, str]]:
    names = _git(clone, "ls-tree", "-r", "--name-only", tag).splitlines()
    for name in names:
        if _MODULE.match(name):
            yield name, _git(clone, "show", f"{tag}:{name}")


def _git(clone: Path, *arguments: str) -> str:
    command = ["git", "-C", str(clone), *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def _extension(path: str) -> str:
    parts = PurePosixPath(path).parts
    return next(part for part in parts if part.startswith(("isaacsim.", "omni.")))


def catalog_lines(types: Types) -> Iterator[str]:
    """Yield the lines of `node_types.yaml`."""
    source = SOURCE.format(tags=TAG)
    yield f"# The node types of Isaac Sim 6.0.1's public source. {source}"
    yield "# by docs/make_node_types.py: change that, not this."
    yield "# What graphs/node_types.yaml says wins; how a port is written is explained there."
    yield ""
    yield "usd_types:  # beside those of graphs/node_types.yaml"
    yield from (f"  {json.dumps(kind)}: {usd}" for kind, usd in USD_TYPES.items())
    yield ""
    yield "types:"
    for name, entry in types.items():
        title = entry.get("metadata", {}).get("uiName") or entry.get("uiName") or name
        yield f"  {name}:"
        yield f"    version: {entry.get('version', 1)}"
        yield f"    name: {json.dumps(title)}"
        yield f"    prim: {prim_name(title)}"
        for side in SIDES:
            if entry.get(side):
                yield f"    {side}:"
                for port, said in entry[side].items():
                    if not port.startswith("$"):
                        text = port_text(said, has_default=side == "inputs")
                        yield f"      {json.dumps(port) if ':' in port else port}: {text}"


def prim_name(title: str) -> str:
    """Return the name that the graph editor gives to a node."""
    return re.sub(r"[^a-z0-9]+", "_", title.lower()).strip("_")


def zero(kind: Any) -> Any:
    """Return what OmniGraph takes for a port without a default, None for what has no value."""
    if not isinstance(kind, str):
        return None
    base, *shape = kind.split("[")
    if shape and shape[-1] == "]":
        return []
    if shape:
        count = int(shape[0].rstrip("]"))
        row = [0.0] * count
        return [row] * count if base.startswith("matrix") else row
    return ZEROS.get(base)


def port_text(said: Mapping[str, Any], *, has_default: bool) -> str:
    """Return a port as the catalog writes it."""
    kind, default, metadata = said["type"], said.get("default"), said.get("metadata", {})
    long: dict[str, Any] = {"type": kind}
    if isinstance(kind, list):
        long = {"type": "union", "of": kind}
    if default is None and has_default:
        default = zero(kind)
    if default is not None and kind != "target" and not isinstance(kind, list):
        long["default"] = default
    tokens = metadata.get("allowedTokens")
    if tokens:
        long["allowed"] = allowed_tokens(tokens)
    if said.get("deprecated"):
        long["deprecated"] = True
    return json.dumps(long) if len(long) > 1 else json.dumps(str(kind))


def allowed_tokens(tokens: Any) -> list[str]:
    """Return the tokens that a port takes, which files list in three ways."""
    if isinstance(tokens, str):
        return [each.strip() for each in tokens.split(",")]
    return [str(token) for token in (tokens.values() if isinstance(tokens, dict) else tokens)]


def rename_lines(clone: Path) -> Iterator[str]:
    """Yield the lines of `renames.yaml`: names of before 4.5, and those that they have now."""
    said = (
        _git(clone, "show", f"{TAG}:{RENAMES}").partition(".omnigraph = [")[2].partition("\n]")[0]
    )
    pairs = _RENAME.findall(said)
    yield "# Names of node types from before Isaac Sim 4.5, by prefix and whole, with those of now."
    yield f"# Facts read off {RENAMES}"
    yield f"# of isaac-sim/IsaacSim {TAG} (Apache-2.0) by docs/make_node_types.py: change that."
    for key, is_whole in (("prefixes", False), ("renamed", True)):
        yield ""
        yield f"{key}:"
        for old, new in pairs:
            if (old.rpartition(".")[2][:1].isupper()) is is_whole:
                yield f"  {old}: {new}"


def version_lines(now: Types, earlier: Mapping[str, Types]) -> Iterator[str]:
    """Yield the lines of `versions.yaml`: what earlier releases had otherwise."""
    source = SOURCE.format(tags=", ".join((*EARLIER.values(), TAG)))
    yield "# What earlier releases of Isaac Sim have otherwise than 6.0.1, by release and type:"
    yield "# `gone` types, types that 6.0.1 `added`, and of the others the ports that are gone,"
    yield "# the ports that the release lacks, and other defaults."
    yield f"# {source}"
    yield "# by docs/make_node_types.py: change that, not this."
    for release, types in earlier.items():
        yield ""
        yield f'"{release}":'
        yield f"  gone: {json.dumps(sorted(set(types) - set(now)))}"
        yield f"  added: {json.dumps(sorted(set(now) - set(types)))}"
        yield "  types:"
        for name in sorted(set(now) & set(types)):
            changes = _changes(_ports(types[name]), _ports(now[name]))
            if changes:
                yield f"    {name}:"
                yield from (f"      {key}: {json.dumps(each)}" for key, each in changes.items())


def _ports(entry: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    return {
        f"{side}:{name}": said
        for side in SIDES
        for name, said in entry.get(side, {}).items()
        if not name.startswith("$")
    }


def _changes(old: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, Any]:
    defaults = {
        name: old[name].get("default")
        for name in sorted(set(old) & set(new))
        if name.startswith("inputs:")
        and old[name].get("default") is not None
        and old[name].get("default") != new[name].get("default")
    }
    found = {
        "gone": sorted(set(old) - set(new)),
        "lacks": sorted(set(new) - set(old)),
        "defaults": defaults,
    }
    return {key: each for key, each in found.items() if each}


def main(clone: Path) -> None:
    """Write the three files."""
    now = node_types(clone, TAG)
    earlier = {release: node_types(clone, tag) for release, tag in EARLIER.items()}
    for name, lines in (
        ("node_types.yaml", catalog_lines(now)),
        ("renames.yaml", rename_lines(clone)),
        ("versions.yaml", version_lines(now, earlier)),
    ):
        (FOLDER / name).write_text("\n".join(lines) + "\n")
    sys.stdout.write(f"{len(now)} node types\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
