"""Writes the files of `graphs/isaac/` that hold facts of Isaac Sim's public source.

Run `python docs/make_node_types.py CLONE PAGES KIT`. CLONE is a git clone of isaac-sim/IsaacSim
with its tags: names, ports, types, defaults and tokens come from the `.ogn` files. PAGES is a JSON
file of what the node pages in its pip packages tell: the types of `omni.physx` in 6.0.1, and
under each later release the types that it `added` and the ports that it `changed`. KIT is a JSON
file of what NVIDIA's published node documentation tells of the library of Kit: `types` by name,
with their ports, and `about` which versions of which extensions were read. A type of Kit alone is
written by `python docs/make_node_types.py --kit KIT`.
"""

from __future__ import annotations

import ast
import json
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import Any

FOLDER = Path(__file__).resolve().parents[1] / "graphs" / "isaac"
TAG = "v6.0.1"
RELEASE = TAG.removeprefix("v")
EARLIER = {"5.0": "v5.0.0", "5.1": "v5.1.0"}
LATER = ("6.1", "6.2")
# What later releases take more, which pages do not list: tokens by type, port and kind of message.
LATER_TOKENS = {
    "isaacsim.ros2.bridge.ROS2CameraHelper": (
        "inputs:type",
        "rgb_hevc",
        "sensor_msgs/msg/CompressedImage",
    ),
    "isaacsim.ros2.bridge.ROS2PublishCompressedImage": ("inputs:input_format", "hevc", ""),
}
TEXTS = ("string", "token", "path")
SIDES = ("inputs", "outputs")
SOURCE = "Facts read off the .ogn files of isaac-sim/IsaacSim {tags} (Apache-2.0)"
_MODULE = re.compile(r"source/\w+/isaacsim\.[^/]+/.*\.ogn$")
# How the application declares OGN types in a file, beside those of omnigraph.yaml.
USD_TYPES = {
    "double[2]": "double2",
    "double[3]": "double3",
    "colorf[4]": "color4f",
    "matrixd[4]": "matrix4d",
    "path": "string",
}
PAGE_TYPES = {  # of node pages alone
    "bundle": "rel",
    "float[4]": "float4",
    "normalf[3]": "normal3f",
    "pointf[3]": "point3f",
    "matrixd[3]": "matrix3d",
    "float[3][]": "float3[]",
    "float[4][]": "float4[]",
    "normalf[3][]": "normal3f[]",
    "vectorf[3][]": "vector3f[]",
}
RENAMES = "source/extensions/isaacsim.core.deprecation_manager/config/extension.toml"
BY_HAND = "# `types` and `ports` are written by hand:"  # how their part of renames.yaml begins
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
    yield "# How a port is written is explained in omnigraph.yaml."
    yield ""
    yield "usd_types:  # beside those of omnigraph.yaml"
    yield from (f"  {json.dumps(kind)}: {usd}" for kind, usd in USD_TYPES.items())
    yield ""
    yield "types:"
    yield from type_lines(types, "  ")


def type_lines(types: Types, indent: str) -> Iterator[str]:
    """Yield the lines of node types as the catalog writes them."""
    for name, entry in types.items():
        title = entry.get("metadata", {}).get("uiName") or entry.get("uiName") or name
        yield f"{indent}{name}:"
        yield f"{indent}  version: {entry.get('version', 1)}"
        yield f"{indent}  name: {json.dumps(title)}"
        yield f"{indent}  prim: {prim_name(title)}"
        if entry.get("is_open"):
            yield f"{indent}  is_open: true"
        for side in SIDES:
            if entry.get(side):
                yield f"{indent}  {side}:"
                for port, said in entry[side].items():
                    if not port.startswith("$"):
                        text = port_text(said, has_default=side == "inputs")
                        key = json.dumps(port) if ":" in port else port
                        yield f"{indent}    {key}: {text}"


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
        row = [ZEROS.get(base, 0.0)] * count
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


def rename_lines(clone: Path, written: str) -> Iterator[str]:
    """Yield the lines of `renames.yaml`: names of before 4.5, and those that they have now.

    `written` is the file as it is: what people wrote into it stays.
    """
    said = (
        _git(clone, "show", f"{TAG}:{RENAMES}").partition(".omnigraph = [")[2].partition("\n]")[0]
    )
    pairs = _RENAME.findall(said)
    yield "# Names of node types from `before` Isaac Sim 4.5, by prefix and whole, and those now."
    yield f"# Facts read off {RENAMES}"
    yield f"# of isaac-sim/IsaacSim {TAG} (Apache-2.0) by docs/make_node_types.py: change that."
    yield BY_HAND + written.partition(BY_HAND)[2].partition("\n\nprefixes:")[0]
    for key, is_whole in (("prefixes", False), ("renamed", True)):
        yield ""
        yield f"{key}:"
        for old, new in pairs:
            if (old.rpartition(".")[2][:1].isupper()) is is_whole:
                yield f"  {old}: {new}"


def version_lines(now: Types, earlier: Mapping[str, Types]) -> Iterator[str]:
    """Yield the lines of `versions.yaml`: what earlier releases had otherwise."""
    source = SOURCE.format(tags=", ".join((*EARLIER.values(), TAG)))
    yield "# What earlier releases of Isaac Sim have otherwise than 6.0.1: types that a release"
    yield "# `lacks`, types that 6.0.1 lacks, and of the others the version, `ports` that 6.0.1"
    yield "# lacks, ports that the release `lacks`, other defaults, and tokens of inputs that take"
    yield "# others."
    yield f"# {source}"
    yield "# by docs/make_node_types.py: change that, not this."
    for release, types in earlier.items():
        gone = {name: entry for name, entry in types.items() if name not in now}
        changed = {
            name: changes_of(types[name], now[name]) for name in sorted(set(now) & set(types))
        }
        yield ""
        yield f'"{release}":'
        yield f"  lacks: {json.dumps(sorted(set(now) - set(types)))}"
        yield from release_lines(gone, changed, "  ")


def release_lines(
    has: Types, changed: Mapping[str, Mapping[str, Any]], indent: str
) -> Iterator[str]:
    """Yield the types that a release has more, and what it has otherwise of the others."""
    if has:
        yield f"{indent}has:"
        yield from type_lines(has, f"{indent}  ")
    yield f"{indent}types:"
    for name, changes in changed.items():
        if changes:
            yield f"{indent}  {name}:"
            yield from (f"{indent}    {key}: {json.dumps(said)}" for key, said in changes.items())


def ports_of(entry: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """Return the ports of a type by their full names."""
    return {
        f"{side}:{name}": said
        for side in SIDES
        for name, said in entry.get(side, {}).items()
        if not name.startswith("$")
    }


def changes_of(entry: Mapping[str, Any], base: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a type of another release has otherwise than that of 6.0.1."""
    other, now = ports_of(entry), ports_of(base)
    both = sorted(set(other) & set(now))
    defaults = {
        name: other[name].get("default")
        for name in both
        if name.startswith("inputs:")
        and other[name].get("default") is not None
        and other[name].get("default") != now[name].get("default")
    }
    tokens = {
        name: tuple(
            allowed_tokens(said.get("metadata", {}).get("allowedTokens") or ())
            for said in (other[name], now[name])
        )
        for name in both
    }
    version = entry.get("version", 1)
    found = {
        "version": None if version == base.get("version", 1) else version,
        "ports": {
            name: json.loads(port_text(other[name], has_default=name.startswith("inputs:")))
            for name in sorted(set(other) - set(now))
        },
        "lacks": sorted(set(now) - set(other)),
        "defaults": defaults,
        "allowed": {name: theirs for name, (theirs, ours) in tokens.items() if theirs != ours},
    }
    return {key: said for key, said in found.items() if said}


def page_types(pages: Mapping[str, Any]) -> Types:
    """Return node types that node pages tell, as `.ogn` files write them."""
    return {
        name: {
            **entry,
            **{
                side: {port: page_port(said) for port, said in entry.get(side, {}).items()}
                for side in SIDES
            },
        }
        for name, entry in sorted(pages.items())
    }


def page_port(said: Mapping[str, Any]) -> dict[str, Any]:
    """Return a port that a node page tells, as `.ogn` files write it."""
    kind, written = said["type"], said["default"]
    if kind.startswith("["):
        return {"type": ast.literal_eval(kind)}
    if kind in TEXTS:
        return {"type": kind, "default": "" if written == "None" else written}
    return {"type": kind, "default": ast.literal_eval(written)}


def page_changes(name: str, said: Mapping[str, Any], base: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a type of a later release has otherwise, by its node page."""
    ports: dict[str, Any] = {}
    defaults: dict[str, Any] = {}
    for side in SIDES:
        for short, change in said.get(side, {}).items():
            port = page_port(change["then"])
            if change[RELEASE] is None:
                text = port_text(port, has_default=side == "inputs")
                ports[f"{side}:{short}"] = json.loads(text)
            else:
                defaults[f"{side}:{short}"] = port["default"]
    version = said.get("version", (None, None))[1]
    found: dict[str, Any] = {"version": version, "ports": ports, "defaults": defaults}
    if name in LATER_TOKENS:
        port_name, token, message = LATER_TOKENS[name]
        tokens = allowed_tokens(ports_of(base)[port_name]["metadata"]["allowedTokens"])
        found["allowed"] = {port_name: [*tokens, token]}
        found["message"] = {token: message} if message else {}
    return {key: each for key, each in found.items() if each}


def later_release_lines(pages: Mapping[str, Any], now: Types) -> Iterator[str]:
    """Yield the lines of `later_releases.yaml`: what only the pip packages tell."""
    yield "# What the node pages in the pip packages of Isaac Sim tell: the types of"
    yield "# omni.physx, which its public source lacks, and what later releases have otherwise than"
    yield "# 6.0.1, as in versions.yaml. By docs/make_node_types.py: change that, not this."
    yield ""
    yield "usd_types:"
    yield from (f"  {json.dumps(kind)}: {usd}" for kind, usd in PAGE_TYPES.items())
    yield ""
    yield "types:"
    yield from type_lines(page_types(pages[f"physx_graph_types_of_{RELEASE}"]), "  ")
    yield ""
    yield "releases:"
    for release in LATER:
        said = pages[release]
        changed = {
            name: page_changes(name, change, now[name])
            for name, change in sorted(said["changed"].items())
        }
        yield f'  "{release}":'
        yield from release_lines(page_types(said["added"]), changed, "    ")


KIT_SOURCE = """\
The node types of Kit's library, whose source is not public: names, ports, types and defaults read \
off NVIDIA's published documentation of the nodes (facts only), by docs/make_node_types.py: change \
that, not this. A type that is_open has more ports than are known. Ports are written as in \
omnigraph.yaml; "of" names the types of a union, or groups of them as omni.graph.tools has them."""
KIT_TYPES = {  # declarations in files, beside those of the others
    "any": "token",
    "unknown": "token",
    **{
        f"{role}{precision}[{size}]{many}": f"{role}{size}{precision}{many}"
        for role, sizes in {"color": "34", "normal": "3", "point": "3", "vector": "3"}.items()
        for size in sizes
        for precision in "dfh"
        for many in ("", "[]")
    },
    **{f"texcoord{each}[{size}]": f"texCoord{size}{each}" for each in "dfh" for size in "23"},
    **{f"quat{each}[4]{many}": f"quat{each}{many}" for each in "dfh" for many in ("", "[]")},
    **{
        f"{kind}[{size}]{many}": f"{kind}{size}{many}"
        for kind in ("double", "float", "half", "int")
        for size in "234"
        for many in ("", "[]")
    },
    **{f"matrixd[{size}]{many}": f"matrix{size}d{many}" for size in "234" for many in ("", "[]")},
    "frame[4]": "frame4d",
    "transform[4]": "frame4d",
}
LEFT_OUT = ("omni.graph.scriptnode.",)  # whose ports their scripts make
_CONSTANT = re.compile(r"^Constant([A-Z].*)")
_WORDS = {"True": True, "False": False, "None": None, "NaN": None}


def kit_data(kit: Mapping[str, Any]) -> dict[str, Any]:
    """Return what `kit_types.json` holds: the types of Kit, by the documentation of its nodes."""
    types: dict[str, Any] = {}
    for name, entry in sorted(kit["types"].items()):
        if name.startswith(LEFT_OUT):
            continue
        title = entry["uiName"] or name.rpartition(".")[2]
        title = _CONSTANT.sub(r"Constant \1", title)  # as the contents of 2.11 (6.0.1) have them
        types[name] = {"version": entry["version"], "name": title, "prim": prim_name(title)}
        if not entry["complete"]:
            types[name]["is_open"] = True
        if entry.get("dynamic"):
            types[name]["grows"] = {each["port"]: kit_port(each) for each in entry["dynamic"]}
        for side in SIDES:
            if entry[side]:
                ports = {port: kit_port(said, side) for port, said in entry[side].items()}
                types[name][side] = ports
    return {
        "about": KIT_SOURCE,
        "releases": kit["about"]["releases"],
        "usd_types": KIT_TYPES,
        "events": [name for name, entry in kit["types"].items() if entry["event_source"]],
        "types": types,
    }


def kit_text(data: Mapping[str, Any]) -> str:
    """Return the text of `kit_types.json`, a type in a line."""
    head = [f'"{key}": {json.dumps(value)}' for key, value in data.items() if key != "types"]
    types = [f'"{name}": {json.dumps(entry)}' for name, entry in data["types"].items()]
    return "{\n" + ",\n".join(head) + ',\n"types": {\n' + ",\n".join(types) + "\n}\n}\n"


def kit_port(said: Mapping[str, Any], side: str = "") -> Any:
    """Return a port that the documentation of Kit tells, as the catalog writes it."""
    kind = "union" if said["type"] == "unknown" else said["type"]
    long: dict[str, Any] = {"type": kind}
    if said.get("union"):
        long["of"] = said["union"]
    default = kit_default(said, kind)
    if side == "inputs" and default is None:
        default = zero(kind)
    if default is not None and kind not in {"target", "bundle", "union", "any", "execution"}:
        long["default"] = default
    if said.get("tokens"):
        long["allowed"] = said["tokens"]
    for key, theirs in (("output_only", "outputOnly"), ("deprecated", "deprecated")):
        if said.get(theirs):
            long[key] = True
    if said.get("literalOnly"):
        long["literal_only"] = True
    return long if len(long) > 1 else kind


def kit_default(said: Mapping[str, Any], kind: str) -> Any:
    """Return the default that a page prints, None where it prints none that can be read."""
    written = said.get("default")
    if written is None:
        return None
    if kind in TEXTS:
        return "" if written == "None" else written
    if written in _WORDS:
        return _WORDS[written]
    if written in {"zeros", "identity"}:
        return identity(kind) if written == "identity" else zero(kind)
    try:
        return ast.literal_eval(written)
    except (ValueError, SyntaxError):
        return None


def identity(kind: str) -> Any:
    """Return the matrix, or the rotation, that changes nothing."""
    if kind.startswith("quat"):
        return [0.0, 0.0, 0.0, 1.0]
    size = int(kind.partition("[")[2].partition("]")[0])
    return [[float(row == column) for column in range(size)] for row in range(size)]


def main(clone: Path, pages: Path) -> None:
    """Write the files that hold what the source and the wheels tell."""
    now = node_types(clone, TAG)
    earlier = {release: node_types(clone, tag) for release, tag in EARLIER.items()}
    for name, lines in (
        ("node_types.yaml", catalog_lines(now)),
        ("renames.yaml", rename_lines(clone, (FOLDER / "renames.yaml").read_text())),
        ("versions.yaml", version_lines(now, earlier)),
        (
            "later_releases.yaml",
            later_release_lines(json.loads(pages.read_text(encoding="utf-8")), now),
        ),
    ):
        (FOLDER / name).write_text("\n".join(lines) + "\n")
    sys.stdout.write(f"{len(now)} node types\n")


def write_kit(kit: Path) -> None:
    """Write the types of Kit."""
    data = json.loads(kit.read_text(encoding="utf-8"))
    (FOLDER / "kit_types.json").write_text(kit_text(kit_data(data)))


if __name__ == "__main__":
    if sys.argv[1] == "--kit":
        write_kit(Path(sys.argv[2]))
    else:
        main(Path(sys.argv[1]), Path(sys.argv[2]))
        write_kit(Path(sys.argv[3]))
