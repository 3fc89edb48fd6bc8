"""Submissions made to stop a grader, to reach out of their folder, or to get a grade for nothing.

Each function writes one submission into an empty folder. `Kit` says where a complete solution
lies that none of them may profit from, and a folder outside that none of them may write to.
"""

# ruff: noqa: ARG001, ARG005 - most have no use for the kit

from __future__ import annotations

import gzip
import io
import os
import random
import stat
import struct
import tarfile
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from pxr import Sdf, Usd, UsdUtils

NAME = "Lab3_04_odometry_tf"
HEAD = '#usda 1.0\n(\n    defaultPrim = "World"\n    metersPerUnit = 1\n    upAxis = "Z"\n)\n'
WORLD = HEAD + 'def Xform "World"\n{\n}\n'


@dataclass(frozen=True)
class Kit:
    """What a hostile submission may aim at."""

    solution: Path
    outside: Path

    @property
    def stage(self) -> Path:
        """The complete stage of the checkpoint that all of them claim to be."""
        return self.solution / f"{NAME}.usda"


Write = Callable[[Path, Kit], None]
INPUTS: dict[str, Write] = {}


def hostile(write: Write) -> Write:
    INPUTS[write.__name__] = write
    return write


def text(folder: Path, content: str | bytes, name: str = f"{NAME}.usda") -> None:
    data = content.encode() if isinstance(content, str) else content
    (folder / name).write_bytes(data)


def arc(kind: str, asset: str, prim: str = "") -> str:
    target = f"<{prim}>" if prim else ""
    return HEAD + f'def Xform "World" (\n    prepend {kind} = {asset}{target}\n)\n{{\n}}\n'


def sublayers(*assets: str) -> str:
    listed = ", ".join(assets)
    return f"#usda 1.0\n(\n    subLayers = [{listed}]\n)\n"


def crate(folder: Path, name: str = f"{NAME}.usd") -> Path:
    layer = Sdf.Layer.CreateAnonymous(".usdc")
    for index in range(200):
        spec = Sdf.CreatePrimInLayer(layer, f"/World/part_{index}")
        spec.specifier = Sdf.SpecifierDef
        Sdf.AttributeSpec(spec, "size", Sdf.ValueTypeNames.Double).default = float(index)
    layer.Export(str(folder / name))
    return folder / name


# -- nesting and size


@hostile
def nested_prims(folder: Path, kit: Kit) -> None:
    depth = 60_000
    text(folder, "#usda 1.0\n" + 'def "a" {\n' * depth + "}\n" * depth)


@hostile
def nested_prims_in_a_crate(folder: Path, kit: Kit) -> None:
    layer = Sdf.Layer.CreateAnonymous(".usdc")
    Sdf.CreatePrimInLayer(layer, "/" + "/".join(["a"] * 700))
    layer.Export(str(folder / f"{NAME}.usd"))


@hostile
def nested_dictionaries(folder: Path, kit: Kit) -> None:
    depth = 20_000
    inner = "dictionary d = {\n" * depth + "}\n" * depth
    text(folder, f"#usda 1.0\n(\n customLayerData = {{\n{inner}}}\n)\n")


@hostile
def nested_lists(folder: Path, kit: Kit) -> None:
    inner = "[1, " * 20_000 + "]" * 20_000
    text(folder, f'#usda 1.0\ndef "a" {{\n int[] x = {inner}\n}}\n')


@hostile
def nested_variants(folder: Path, kit: Kit) -> None:
    depth = 3000
    opened = 'variantSet "v" = {\n"x" {\n' * depth
    text(folder, '#usda 1.0\ndef "a" {\n' + opened + "}\n}\n" * depth + "}\n")


@hostile
def a_quarter_of_a_million_prims(folder: Path, kit: Kit) -> None:
    body = "".join(f'def "p{index}" {{\n}}\n' for index in range(250_000))
    text(folder, "#usda 1.0\n" + body)


@hostile
def a_huge_array(folder: Path, kit: Kit) -> None:
    numbers = ", ".join(["1"] * 100_000)
    text(folder, f'#usda 1.0\ndef "World" {{\n int[] x = [{numbers}]\n}}\n')


@hostile
def a_file_beyond_the_limit(folder: Path, kit: Kit) -> None:
    text(folder, WORLD)
    os.truncate(folder / f"{NAME}.usda", 100_000_000)


@hostile
def a_long_chain_of_sublayers(folder: Path, kit: Kit) -> None:
    for index in range(150):
        text(folder, sublayers(f"@./chain_{index + 1}.usda@"), f"chain_{index}.usda")
    text(folder, sublayers("@./chain_0.usda@"))


@hostile
def a_thousand_files(folder: Path, kit: Kit) -> None:
    text(folder, WORLD)
    for index in range(1_000):
        (folder / f"f{index}.txt").touch()


@hostile
def folders_in_folders(folder: Path, kit: Kit) -> None:
    deep = folder
    for _ in range(60):
        deep /= "d"
    deep.mkdir(parents=True)
    text(deep, WORLD)


# -- composition that explodes


@hostile
def an_instancing_bomb(folder: Path, kit: Kit) -> None:
    levels = ['def Xform "L0" {\n}\n']
    for level in range(1, 12):
        inner = "".join(
            f'def "c{child}" (\n prepend references = </L{level - 1}>\n) {{\n}}\n'
            for child in range(10)
        )
        levels.append(f'def Xform "L{level}" {{\n{inner}}}\n')
    text(folder, HEAD + "".join(levels))


@hostile
def instances_of_instances(folder: Path, kit: Kit) -> None:
    levels = ['def Xform "L0" {\n}\n']
    for level in range(1, 14):
        inner = "".join(
            f'def "c{child}" (\n instanceable = true\n'
            f" prepend references = </L{level - 1}>\n) {{\n}}\n"
            for child in range(8)
        )
        levels.append(f'def Xform "L{level}" {{\n{inner}}}\n')
    text(folder, HEAD + "".join(levels))


@hostile
def a_variant_explosion(folder: Path, kit: Kit) -> None:
    sets = [f"s{index}" for index in range(40)]
    body = "".join(
        f'variantSet "{name}" = {{\n'
        + "".join(f'"v{value}" {{\n def "c_{name}_{value}" {{\n}}\n}}\n' for value in range(100))
        + "}\n"
        for name in sets
    )
    names = ", ".join(f'"{name}"' for name in sets)
    text(folder, f'#usda 1.0\ndef "World" (\n prepend variantSets = [{names}]\n) {{\n{body}}}\n')


@hostile
def files_that_refer_to_each_other(folder: Path, kit: Kit) -> None:
    text(folder, arc("references", "@./other.usda@", "/World"))
    text(folder, arc("references", f"@./{NAME}.usda@", "/World"), "other.usda")


@hostile
def sublayers_of_each_other(folder: Path, kit: Kit) -> None:
    text(folder, sublayers("@./other.usda@"))
    text(folder, sublayers(f"@./{NAME}.usda@"), "other.usda")


# -- reaching out


@hostile
def a_reference_to_a_pipe(folder: Path, kit: Kit) -> None:
    os.mkfifo(folder / "pipe.usda")
    text(folder, arc("references", "@./pipe.usda@"))


@hostile
def a_pipe_as_sublayer(folder: Path, kit: Kit) -> None:
    os.mkfifo(folder / "pipe.usda")
    text(folder, sublayers("@pipe.usda@"))


@hostile
def a_pipe_as_stage(folder: Path, kit: Kit) -> None:
    os.mkfifo(folder / f"{NAME}.usda")


@hostile
def a_pipe_outside(folder: Path, kit: Kit) -> None:
    pipe = kit.outside / "waiting.usda"
    if not pipe.exists():
        os.mkfifo(pipe)
    text(folder, arc("payload", f"@{pipe}@"))


@hostile
def a_link_to_a_device(folder: Path, kit: Kit) -> None:
    (folder / f"{NAME}.usda").symlink_to("/dev/zero")


@hostile
def the_solution_behind_another_layer(folder: Path, kit: Kit) -> None:
    text(folder, sublayers("@./between.usda@"))
    text(folder, sublayers(f"@{kit.stage}@"), "between.usda")


@hostile
def the_solution_twice_in_two_arcs(folder: Path, kit: Kit) -> None:
    asset = f"@{os.path.relpath(kit.stage, folder)}@"
    text(
        folder,
        f"#usda 1.0\n(\n subLayers = [{asset}]\n)\n"
        f'def "World" (\n prepend payload = {asset}</World>\n) {{\n}}\n',
    )


@hostile
def the_solution_as_link(folder: Path, kit: Kit) -> None:
    (folder / f"{NAME}.usda").symlink_to(kit.stage)


@hostile
def the_solution_behind_a_folder_link(folder: Path, kit: Kit) -> None:
    (folder / "work").symlink_to(kit.solution)


@hostile
def the_solution_behind_two_links(folder: Path, kit: Kit) -> None:
    (folder / "near.usda").symlink_to(kit.stage)
    (folder / f"{NAME}.usda").symlink_to("near.usda")


@hostile
def the_solution_over_a_linked_folder(folder: Path, kit: Kit) -> None:
    (folder / "assets").symlink_to(kit.solution)
    text(folder, sublayers(f"@./assets/{NAME}.usda@"))


@hostile
def a_link_in_a_circle(folder: Path, kit: Kit) -> None:
    (folder / f"{NAME}.usda").symlink_to(f"{NAME}.usda")


@hostile
def a_material_that_includes_a_file(folder: Path, kit: Kit) -> None:
    text(folder, arc("references", "@./look.mtlx@"))
    (folder / "look.mtlx").write_text(
        '<?xml version="1.0"?><materialx version="1.38" '
        'xmlns:xi="http://www.w3.org/2001/XInclude"><xi:include href="/etc/passwd"/></materialx>'
    )


@hostile
def own_file_with_format_arguments(folder: Path, kit: Kit) -> None:
    text(folder, sublayers("@./own.usda:SDF_FORMAT_ARGS:a=b@"))
    text(folder, WORLD, "own.usda")


# -- bytes


@hostile
def a_cut_text(folder: Path, kit: Kit) -> None:
    data = kit.stage.read_bytes()
    text(folder, data[: len(data) * 2 // 3])


@hostile
def a_cut_crate(folder: Path, kit: Kit) -> None:
    path = crate(folder)
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])


@hostile
def a_crate_with_flipped_bits(folder: Path, kit: Kit) -> None:
    path = crate(folder)
    data = bytearray(path.read_bytes())
    chance = random.Random(7)  # noqa: S311 - the same bits every time
    for _ in range(400):
        data[chance.randrange(88, len(data))] ^= 1 << chance.randrange(8)
    path.write_bytes(bytes(data))


@hostile
def a_crate_whose_counts_lie(folder: Path, kit: Kit) -> None:
    path = crate(folder)
    data = bytearray(path.read_bytes())
    (start,) = struct.unpack_from("<q", data, 16)
    for index in range(struct.unpack_from("<Q", data, start)[0]):
        _, section, _ = struct.unpack_from("<16sqq", data, start + 8 + 32 * index)
        struct.pack_into("<Q", data, section, 1 << 40)
    path.write_bytes(bytes(data))


@hostile
def a_crate_whose_contents_lie_outside(folder: Path, kit: Kit) -> None:
    path = crate(folder)
    data = bytearray(path.read_bytes())
    struct.pack_into("<q", data, 16, 1 << 50)
    path.write_bytes(bytes(data))


@hostile
def a_crate_called_text(folder: Path, kit: Kit) -> None:
    path = crate(folder)
    path.rename(folder / f"{NAME}.usda")


@hostile
def nul_bytes(folder: Path, kit: Kit) -> None:
    data = kit.stage.read_bytes()
    text(folder, data[:2000] + b"\0" * 8 + data[2000:])


@hostile
def line_ends_of_windows_cut_short(folder: Path, kit: Kit) -> None:
    data = kit.stage.read_bytes().replace(b"\n", b"\r\n")
    text(folder, data[: len(data) // 2])


@hostile
def markup_in_names_and_values(folder: Path, kit: Kit) -> None:
    evil = "<script>alert(1)</script>{{ 7*7 }}=cmd|' /C calc'!A0"
    text(
        folder,
        HEAD + 'def Xform "World" {\n def OmniGraph "ROS_Clock" {\n def OmniGraphNode "n" {\n'
        f' custom string inputs:topicName = "{evil}"\n token node:type = "{evil}"\n }}\n }}\n}}\n',
    )


# -- packages


def package(folder: Path, entries: dict[str, bytes], method: int = zipfile.ZIP_STORED) -> None:
    with zipfile.ZipFile(folder / f"{NAME}.usdz", "w", method) as packed:
        for name, data in entries.items():
            packed.writestr(name, data)


@hostile
def a_package_with_names_that_lead_out(folder: Path, kit: Kit) -> None:
    package(folder, {"../../evil.usda": kit.stage.read_bytes(), "/etc/evil.usda": b"#usda 1.0"})


@hostile
def a_package_that_refers_to_the_solution(folder: Path, kit: Kit) -> None:
    text(folder, sublayers(f"@{kit.stage}@"), "inner.usda")
    UsdUtils.CreateNewUsdzPackage(str(folder / "inner.usda"), str(folder / "whole.usdz"))
    layer = sublayers(f"@{kit.stage}@").encode()
    (folder / "whole.usdz").unlink(missing_ok=True)
    (folder / "inner.usda").unlink()
    package(folder, {"inner.usda": layer})


@hostile
def a_package_in_a_package(folder: Path, kit: Kit) -> None:
    inner = io.BytesIO()
    with zipfile.ZipFile(inner, "w") as packed:
        packed.writestr("inner.usda", kit.stage.read_bytes())
    package(folder, {"inner.usdz": inner.getvalue()})


@hostile
def a_squeezed_package(folder: Path, kit: Kit) -> None:
    package(folder, {"inner.usda": kit.stage.read_bytes()}, zipfile.ZIP_DEFLATED)


@hostile
def nested_prims_in_a_package(folder: Path, kit: Kit) -> None:
    depth = 20_000
    package(folder, {"a.usda": ("#usda 1.0\n" + 'def "a" {\n' * depth + "}\n" * depth).encode()})


@hostile
def a_damaged_package(folder: Path, kit: Kit) -> None:
    package(folder, {"a.usda": kit.stage.read_bytes()})
    path = folder / f"{NAME}.usdz"
    path.write_bytes(path.read_bytes()[:-40])


# -- code


@hostile
def modules_of_python(folder: Path, kit: Kit) -> None:
    (folder / "work").mkdir()
    text(folder / "work", WORLD)
    trap = f"open({str(kit.outside / 'executed')!r}, 'w').write('yes')\n"
    for name in ("json", "yaml", "sitecustomize", "usercustomize", "networkx", "pxr", "jinja2"):
        (folder / f"{name}.py").write_text(trap)
        (folder / "work" / f"{name}.py").write_text(trap)


@hostile
def a_plugin_of_usd(folder: Path, kit: Kit) -> None:
    text(folder, WORLD)
    (folder / "plugInfo.json").write_text(
        '{"Plugins": [{"Name": "evil", "Type": "python", "Root": ".", "Info": {}}]}'
    )


@hostile
def a_script_node(folder: Path, kit: Kit) -> None:
    code = f"open('{kit.outside / 'executed'}', 'w')"
    text(
        folder,
        HEAD + 'def Xform "World" {\n def OmniGraph "ROS_Clock" {\n def OmniGraphNode "n" {\n'
        ' token node:type = "omni.graph.scriptnode.ScriptNode"\n'
        f' custom string inputs:script = """{code}"""\n }}\n }}\n}}\n',
    )


# -- what lies beside the stages


@hostile
def a_map_that_unfolds(folder: Path, kit: Kit) -> None:
    (folder / "work").mkdir()
    (folder / "maps").mkdir()
    text(folder / "work", WORLD)
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 12)]
    (folder / "maps" / "turtlebot3_map.yaml").write_text("\n".join(lines) + "\nimage: *a11\n")


@hostile
def a_map_of_brackets(folder: Path, kit: Kit) -> None:
    (folder / "work").mkdir()
    (folder / "maps").mkdir()
    text(folder / "work", WORLD)
    (folder / "maps" / "turtlebot3_map.yaml").write_text("[" * 50_000)


@hostile
def a_gigantic_map(folder: Path, kit: Kit) -> None:
    (folder / "work").mkdir()
    (folder / "maps").mkdir()
    text(folder / "work", WORLD)
    (folder / "maps" / "turtlebot3_map.yaml").write_text(
        "image: turtlebot3_map.pgm\nmode: trinary\nresolution: 0.05\norigin: [-6.2, -3.32, 0]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n"
    )
    (folder / "maps" / "turtlebot3_map.pgm").write_bytes(b"P5\n2000000000 2000000000\n255\n\0")


@hostile
def evidence_without_end(folder: Path, kit: Kit) -> None:
    (folder / "work").mkdir()
    (folder / "results").mkdir()
    text(folder / "work", WORLD)
    (folder / "results" / "topics.txt").write_bytes(b"/scan\n" * 50_000)
    (folder / "results" / "line.txt").write_bytes(b"- " * 100_000)


@hostile
def names_that_do_not_print(folder: Path, kit: Kit) -> None:
    text(folder, WORLD)
    for name in (b"line\nend.usda", b"\xff\xfe.usda", b"\x1b[2J.usda", b"=1+1.usda"):
        (folder / os.fsdecode(name)).write_bytes(WORLD.encode())


# -- archives; the function writes the archive beside the folder that it is given


def zipped(folder: Path, entries: list[tuple[str | zipfile.ZipInfo, bytes]]) -> Path:
    path = folder.with_name(f"{folder.name}.zip")
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, data in entries:
            packed.writestr(name, data)
    return path


@hostile
def a_zip_with_names_that_lead_out(folder: Path, kit: Kit) -> None:
    outside = str(kit.outside / "written.usda")
    names = ["../../../written.usda", outside, "..\\..\\written.usda", "C:\\written.usda"]
    entries: list[tuple[str | zipfile.ZipInfo, bytes]] = [(name, b"#usda 1.0") for name in names]
    zipped(folder, [*entries, (f"{NAME}.usda", WORLD.encode())])


@hostile
def a_zip_with_a_link(folder: Path, kit: Kit) -> None:
    link = zipfile.ZipInfo(f"{NAME}.usda")
    link.create_system = 3
    link.external_attr = (stat.S_IFLNK | 0o777) << 16
    zipped(folder, [(link, str(kit.stage).encode())])


@hostile
def a_zip_bomb(folder: Path, kit: Kit) -> None:
    zipped(folder, [(f"{NAME}.usda", b"#usda 1.0\n" + b"\n" * 12_000_000)])


@hostile
def a_zip_bomb_in_a_zip(folder: Path, kit: Kit) -> None:
    inner = io.BytesIO()
    with zipfile.ZipFile(inner, "w", zipfile.ZIP_DEFLATED) as packed:
        packed.writestr(f"{NAME}.usda", b"#usda 1.0\n" + b"\n" * 12_000_000)
    zipped(folder, [("inner.zip", inner.getvalue())])


@hostile
def a_zip_of_five_thousand_files(folder: Path, kit: Kit) -> None:
    zipped(folder, [(f"f{index}", b"") for index in range(5_000)])


@hostile
def a_zip_with_a_password(folder: Path, kit: Kit) -> None:
    path = zipped(folder, [(f"{NAME}.usda", kit.stage.read_bytes())])
    data = bytearray(path.read_bytes())
    data[6] |= 1
    data[data.index(b"PK\x01\x02") + 8] |= 1
    path.write_bytes(bytes(data))


@hostile
def a_zip_with_damaged_contents(folder: Path, kit: Kit) -> None:
    path = zipped(folder, [(f"{NAME}.usda", kit.stage.read_bytes())])
    data = bytearray(path.read_bytes())
    data[200:260] = bytes(60)
    path.write_bytes(bytes(data))


@hostile
def a_cut_zip(folder: Path, kit: Kit) -> None:
    path = zipped(folder, [(f"{NAME}.usda", kit.stage.read_bytes())])
    path.write_bytes(path.read_bytes()[:-100])


@hostile
def a_zip_that_is_none(folder: Path, kit: Kit) -> None:
    folder.with_name(f"{folder.name}.zip").write_text("Rar!")


@hostile
def an_archive_of_another_kind(folder: Path, kit: Kit) -> None:
    folder.with_name(f"{folder.name}.rar").write_bytes(b"Rar!\x1a\x07\x01\x00")


@hostile
def a_pipe_called_zip(folder: Path, kit: Kit) -> None:
    os.mkfifo(folder.with_name(f"{folder.name}.zip"))


def tarred(folder: Path, members: Iterator[tuple[tarfile.TarInfo, bytes]], ending: str) -> None:
    mode = "w:gz" if ending.endswith("gz") else "w"
    with tarfile.open(folder.with_name(folder.name + ending), mode) as packed:
        for member, data in members:
            member.size = len(data)
            packed.addfile(member, io.BytesIO(data))


@hostile
def a_tar_with_links_and_devices(folder: Path, kit: Kit) -> None:
    def members() -> Iterator[tuple[tarfile.TarInfo, bytes]]:
        kinds = {
            "hard.usda": tarfile.LNKTYPE,
            f"{NAME}.usda": tarfile.SYMTYPE,
            "pipe.usda": tarfile.FIFOTYPE,
            "zero.usda": tarfile.CHRTYPE,
        }
        for name, kind in kinds.items():
            member = tarfile.TarInfo(name)
            member.type, member.linkname = kind, str(kit.stage)
            yield member, b""

    tarred(folder, members(), ".tar")


@hostile
def a_tar_with_names_that_lead_out(folder: Path, kit: Kit) -> None:
    names = ["../../written.usda", str(kit.outside / "written.usda")]
    tarred(folder, iter([(tarfile.TarInfo(name), b"#usda 1.0") for name in names]), ".tgz")


@hostile
def a_tar_bomb(folder: Path, kit: Kit) -> None:
    data = b"\n" * 12_000_000
    tarred(folder, iter([(tarfile.TarInfo(f"{NAME}.usda"), data)]), ".tar.gz")


@hostile
def a_link_then_a_file_through_it(folder: Path, kit: Kit) -> None:
    link = tarfile.TarInfo("out")
    link.type, link.linkname = tarfile.SYMTYPE, str(kit.outside)
    tarred(folder, iter([(link, b""), (tarfile.TarInfo("out/written.usda"), b"x")]), ".tar")


def make_kit(folder: Path, build: Callable[[str, Path], Path]) -> Kit:
    """Make a solution and an outside below `folder`; `build` writes a checkpoint stage."""
    solution, outside = folder / "solution", folder / "outside"
    outside.mkdir(parents=True)
    solution.mkdir()
    build("04", solution / f"{NAME}.usda")
    Usd.Stage.Open(str(solution / f"{NAME}.usda"))
    return Kit(solution, outside)


# What is one text, in the file of a stage.
TEXTS: dict[str, Callable[[Path, Kit], str | bytes]] = {
    "nested_tuples": lambda folder, kit: (
        'def "a" {\n double3 x = ' + "(" * 100_000 + ")" * 100_000 + "\n}\n"
    ),
    "an_enormous_string": lambda folder, kit: (
        '#usda 1.0\ndef "World" {\n string s = "' + "x" * 3_000_000 + '"\n}\n'
    ),
    "an_enormous_prim_name": lambda folder, kit: f'#usda 1.0\ndef "{"n" * 1_000_000}" {{\n}}\n',
    "ten_thousand_missing_sublayers": lambda folder, kit: sublayers(
        *(f"@./gone_{index}.usda@" for index in range(10_000))
    ),
    "a_prim_that_refers_to_itself": lambda folder, kit: arc("references", "", "/World"),
    "prims_that_inherit_from_each_other": lambda folder, kit: (
        '#usda 1.0\ndef "A" (\n inherits = </B>\n) {\n}\ndef "B" (\n specializes = </A>\n) {\n}\n'
    ),
    "a_child_that_refers_to_its_parent": lambda folder, kit: (
        '#usda 1.0\ndef "World" {\n def "c" (\n prepend references = </World>\n ) {\n }\n}\n'
    ),
    "a_file_that_refers_to_itself": lambda folder, kit: arc("references", f"@./{NAME}.usda@"),
    "a_payload_of_itself": lambda folder, kit: arc("payload", f"@{NAME}.usda@", "/World"),
    "a_sublayer_of_itself": lambda folder, kit: sublayers(f"@./{NAME}.usda@"),
    "a_reference_to_a_device": lambda folder, kit: arc("references", "@/dev/zero@"),
    "a_reference_to_standard_input": lambda folder, kit: arc("references", "@/dev/stdin@"),
    "a_reference_to_a_system_file": lambda folder, kit: arc(
        "references", "@../../../../../../../etc/passwd@"
    ),
    "the_solution_as_reference": lambda folder, kit: arc("references", f"@{kit.stage}@", "/World"),
    "the_solution_as_sublayer": lambda folder, kit: sublayers(f"@{kit.stage}@"),
    "the_solution_as_relative_sublayer": lambda folder, kit: sublayers(
        f"@{os.path.relpath(kit.stage, folder)}@"
    ),
    "the_solution_far_above": lambda folder, kit: sublayers(
        "@" + "../" * 40 + f"{str(kit.stage).lstrip('/')}@"
    ),
    "the_solution_as_payload": lambda folder, kit: arc("payload", f"@{kit.stage}@", "/World"),
    "the_solution_in_a_variant": lambda folder, kit: (
        '#usda 1.0\ndef "World" (\n variants = {\n string v = "x"\n }\n prepend variantSets = "v"\n'
        ') {\n variantSet "v" = {\n "x" (\n'
        f" prepend references = @{kit.stage}@</World>\n ) {{\n }}\n }}\n}}\n"
    ),
    "the_solution_by_address": lambda folder, kit: sublayers(f"@file://{kit.stage}@"),
    "the_solution_by_expression": lambda folder, kit: (
        f'#usda 1.0\n(\n expressionVariables = {{\n string S = "{kit.stage}"\n }}\n'
        ' subLayers = [@`"${S}"`@]\n)\n'
    ),
    "the_solution_with_arguments": lambda folder, kit: sublayers(
        f"@{kit.stage}:SDF_FORMAT_ARGS:target=usd@"
    ),
    "the_solution_as_value_clips": lambda folder, kit: (
        '#usda 1.0\ndef "World" (\n clips = {\n dictionary default = {\n'
        f" asset[] assetPaths = [@{kit.stage}@]\n asset manifestAssetPath = @{kit.stage}@\n"
        ' string primPath = "/World"\n double2[] active = [(0, 0)]\n }\n }\n) {\n'
        " custom double x\n}\n"
    ),
    "the_solution_at_home": lambda folder, kit: sublayers(
        f"@~/{NAME}.usda@", f"@$HOME/{NAME}.usda@"
    ),
    "a_graph_on_a_server": lambda folder, kit: (
        HEAD + 'def Xform "World" {\n def OmniGraph "ROS_Clock" (\n'
        " prepend references = @https://example.invalid/clock.usda@</ROS_Clock>\n ) {\n }\n}\n"
    ),
    "a_reference_to_a_nucleus_server": lambda folder, kit: arc(
        "references", "@omniverse://localhost/NVIDIA/solution.usd@"
    ),
    "a_reference_to_a_share": lambda folder, kit: arc(
        "references", r"@\\server\share\solution.usd@"
    ),
    "a_reference_to_a_drive": lambda folder, kit: arc(
        "references", "@C:/Users/grader/solution.usd@"
    ),
    "a_search_path": lambda folder, kit: sublayers(f"@{kit.solution.name}/{NAME}.usda@"),
    "an_empty_file": lambda folder, kit: b"",
    "only_the_first_line": lambda folder, kit: "#usda 1.0",
    "bytes_that_are_no_text": lambda folder, kit: WORLD.encode() + b'def "\xff\xfe\x80" {\n}\n',
    "line_ends_of_old_macs": lambda folder, kit: kit.stage.read_bytes().replace(b"\n", b"\r"),
    "a_byte_order_mark": lambda folder, kit: b"\xef\xbb\xbf" + kit.stage.read_bytes(),
    "two_bytes_a_letter": lambda folder, kit: kit.stage.read_text().encode("utf-16"),
    "random_bytes": lambda folder, kit: random.Random(1).randbytes(50_000),  # noqa: S311 - no secret
    "a_web_page": lambda folder, kit: "<!DOCTYPE html><html><body>Please log in</body></html>",
    "a_packed_stage": lambda folder, kit: gzip.compress(kit.stage.read_bytes()),
    "a_version_from_the_future": lambda folder, kit: kit.stage.read_bytes().replace(
        b"#usda 1.0", b"#usda 99.0", 1
    ),
    "codes_for_the_terminal": lambda folder, kit: (
        HEAD + 'def Xform "World" {\n def OmniGraph "ROS_Clock" {\n def OmniGraphNode "n" {\n'
        ' token node:type = "\x1b]0;owned\x07\x1b[2J\u202e"\n }\n }\n}\n'
    ),
}


def _writing(content: Callable[[Path, Kit], str | bytes]) -> Write:
    return lambda folder, kit: text(folder, content(folder, kit))


INPUTS |= {name: _writing(content) for name, content in TEXTS.items()}


def write_all(place: Path, kit: Kit) -> list[str]:
    """Write every hostile submission below `place`, and return their names."""
    for name, write in INPUTS.items():
        folder = place / name
        folder.mkdir(parents=True)
        write(folder, kit)
        if not any(folder.iterdir()):
            folder.rmdir()
    return list(INPUTS)
