"""Stages of the second author with one fault and many comments, and what a repair did to them."""

from __future__ import annotations

import difflib
import random
import re
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import patch

from agreement import Subject
from breaking import the_lab
from msgspec.structs import replace
from pxr import Sdf, Usd
from random_edits import edit
from sabotage import Fault, graph_faults
from scene_sabotage import scene_sabotage
from second_author import Style, author_lab

from lab3_usd.check.checker import judge
from lab3_usd.check.match.graphs import match_all
from lab3_usd.check.rule_runs import RuleResults
from lab3_usd.errors import StageError
from lab3_usd.fix import repairing
from lab3_usd.fix.repairing import Fixed, FixOptions, fix_linted, fix_stage
from lab3_usd.fix.source_tree import ROOT, read_blocks
from lab3_usd.isaac.graph import PortRef
from lab3_usd.isaac.releases import BASE
from lab3_usd.model.finding import Finding, site_of
from lab3_usd.model.stage import StageModel
from lab3_usd.pipeline.any_stage import lint_platform
from lab3_usd.sim.any_stage import effects_of
from lab3_usd.sim.dry_run import dry_run
from lab3_usd.sim.judge.topics import expected_at
from lab3_usd.spec.graph import GraphSpec, Wire
from lab3_usd.spec.lab import Checkpoint, Lab
from lab3_usd.spec.load.loader import load_lab
from lab3_usd.stage.read.opening import open_stage
from lab3_usd.stage.read.stage_reader import read_model
from lab3_usd.stage.write.starter import starter_layer


def worsened(subject: Subject, folder: Path, release: str = BASE) -> list[str]:
    """Say what is worse after the safe repairs of a stage, which are written into a copy."""
    path = subject.make if isinstance(subject.make, Path) else _saved(subject.make(), folder)
    ways = [lambda: fix_linted(path, release, FixOptions())]
    if subject.checkpoint:
        ways.append(lambda: fix_stage(path, subject.checkpoint, the_lab(), FixOptions()))
    return [text for fix in ways for text in _worse(path, fix, folder, release)]


def _saved(stage: Any, folder: Path) -> Path:
    path = folder / "stage.usda"
    stage.GetRootLayer().Export(str(path))
    return path


def _worse(path: Path, fix: Any, folder: Path, release: str) -> list[str]:
    try:
        fixed: Fixed = fix()
    except StageError:  # no stage, or a package
        return []
    if fixed.files.keys() != {path}:
        return []
    known = {site_of(finding) for finding in fixed.before if finding.severity == "error"}
    after = [finding for finding in fixed.after if finding.severity == "error"]
    new = [f"{each.rule} {each.prim}" for each in after if site_of(each) not in known]
    worse = [", ".join(new)] if len(after) > len(known) else []
    repaired = folder / f"repaired{path.suffix}"
    repaired.write_bytes(fixed.files[path])
    platform = lint_platform(release)
    before, now = (effects_of(open_stage(each), platform) for each in (path, repaired))
    return [*worse, *sorted(before - now)]


ONLY_IN_THE_STARTER = ("in the starter", "lidar link moved")
_MARK = re.compile(r"# note \d+")
_PROPERTY = re.compile(r"^\s+(?:custom |uniform |prepend )?\w+(?:\[\])? [\w:.]+(?: = [^({\[\"]+)?$")


EDITOR = Style(names="editor")
STYLES = (
    EDITOR,
    Style(names="menu", values="all", noise=True),
    Style(names="random", seed=3, values="needed", declare="used", editor_api=False),
    Style(list_edits=True, old_versions=True, backwards=True, slash=False),
)


@cache
def second_stage(checkpoint: str, style: Style = EDITOR) -> Sdf.Layer:
    """The stage of the second author."""
    stage = Usd.Stage.CreateInMemory(".usda")
    stage.GetRootLayer().TransferContent(starter_layer(load_lab().folder))
    author_lab(stage, checkpoint, style)
    layer = Sdf.Layer.CreateAnonymous(".usda")  # which lives on without its stage
    layer.TransferContent(stage.GetRootLayer())
    return layer


@cache
def second_faults(checkpoint: str) -> tuple[Fault, ...]:
    """Every single fault of that stage: of its graphs, and of its scene."""
    lab = load_lab()
    asked = lab.checkpoints[checkpoint]
    stage = Usd.Stage.Open(second_stage(checkpoint))
    matched = match_all(lab.graphs, read_model(stage, lab.platform, "second"), lab.platform.scripts)
    graphs = {
        name: _named(lab.graphs[name], {r: n.name for r, n in matched[name].node_of.items() if n})
        for name in asked.graphs
    }
    named = replace(lab, graphs={**lab.graphs, **graphs})
    return (*graph_faults(named, asked), *_scene_faults(checkpoint))


def _scene_faults(checkpoint: str) -> Iterator[Fault]:
    for each in scene_sabotage():
        only_there = each.checkpoint == "00" and each.name.endswith(ONLY_IN_THE_STARTER)
        if each.checkpoint <= checkpoint and not (only_there and checkpoint != "00"):
            yield Fault(each.name, "scene", each.apply, (each.site[0],))


def _named(spec: GraphSpec, names: dict[str, str]) -> GraphSpec:
    """Return the spec with its roles called as the prims are."""

    def end(ref: PortRef) -> PortRef:
        return PortRef(names[ref.role], ref.port)

    def wire(each: Wire) -> Wire:
        return Wire(end(each.source), end(each.target), each.handout)

    nodes = {names[role]: replace(each, role=names[role]) for role, each in spec.nodes.items()}
    return replace(spec, nodes=nodes, wires=tuple(map(wire, spec.wires)))


def commented(text: str) -> str:
    """Return a text layer with comments before, behind and between its statements."""
    lines: list[str] = []
    for number, line in enumerate(text.split("\n")):
        is_property = _PROPERTY.match(line) is not None
        if is_property and number % 7 == 0:
            lines.append(f"{line[: len(line) - len(line.lstrip())]}# note {number}")
        lines.append(f"{line}  # note {number}" if is_property and number % 3 == 0 else line)
    return "\n".join(lines)


def broken_text(checkpoint: str, fault: Fault) -> str | None:
    """Return the commented text of the stage with a fault; None where it cannot be made there."""
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.TransferContent(second_stage(checkpoint))
    try:
        fault.break_it(Usd.Stage.Open(layer))
    except (AttributeError, RuntimeError):  # the second author wrote something else there
        return None
    return commented(layer.ExportToString())


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a repair did: whether the stage passes, and to which lines."""

    fault: Fault
    fixed: Fixed
    before: str
    after: str

    @property
    def passes(self) -> bool:
        """Whether no error is left."""
        return not has_errors(self.fixed.after)

    @property
    def lines(self) -> int:
        """The lines of the diff: those taken out and those put in."""
        return sum(len(gone) + len(new) for gone, new in self._hunks())

    @property
    def lost_comments(self) -> list[str]:
        """The comments that are gone though what they stand in was not removed."""
        kept = Counter(_MARK.findall(self.after))
        gone = Counter(_MARK.findall(self.before)) - kept
        removed = [each.prim for each in self._edits() if each.__class__.__name__ == "RemovePrim"]
        for path in removed:
            block = read_blocks(self.before).get(path)
            gone -= Counter(_MARK.findall(self.before[block.start : block.end]) if block else ())
        return [*gone]

    @property
    def elsewhere(self) -> list[str]:
        """The prims whose own text changed though no edit names them."""
        edits = self._edits()
        if any(hasattr(each, "to") for each in edits):
            return []  # what names a moved prim follows it
        named = {each.prim for each in edits}
        before, after = own_texts(self.before), own_texts(self.after)
        return [
            path
            for path in before.keys() & after.keys()
            if before[path] != after[path] and not _is_named(path, named)
        ]

    def _edits(self) -> list[Any]:
        return [edit for repair in self.fixed.repairs for edit in repair.edits]

    def _hunks(self) -> list[tuple[range, range]]:
        one, other = self.before.split("\n"), self.after.split("\n")
        matcher = difflib.SequenceMatcher(None, one, other, autojunk=False)
        return [
            (range(a, b), range(c, d))
            for kind, a, b, c, d in matcher.get_opcodes()
            if kind != "equal"
        ]


def own_texts(text: str) -> dict[str, str]:
    """Return the text of each prim without that of its children, and without blank lines."""
    blocks = [read_block for read_block in read_blocks(text).values() if read_block.path != ROOT]
    found = {}
    for block in blocks:
        pos, parts = block.start, []
        for child in sorted(blocks, key=lambda each: each.start):
            if block.start < child.start < block.end and child.start >= pos:
                parts.append(text[pos : child.start])
                pos = child.end
        parts.append(text[pos : block.end])
        lines = "".join(parts).split("\n")
        found[block.path] = "\n".join(line for line in lines if line.strip())
    return found


def _is_named(path: str, named: set[str]) -> bool:
    return any(path == each or path.startswith(f"{each}/") or each == ROOT for each in named)


def repaired(checkpoint: str, fault: Fault, folder: Path, lab: Lab) -> Outcome | None:
    """Repair the stage with a fault; None where the fault is none in this stage."""
    text = broken_text(checkpoint, fault)
    if text is None:
        return None
    path = folder / f"{lab.checkpoints[checkpoint].file}_{abs(hash(fault.name))}.usda"
    path.write_text(text)
    fixed = fix_stage(path, checkpoint, lab, FixOptions(unsafe=True))
    path.unlink()
    if not any(each.severity != "note" for each in fixed.before):
        return None
    data = next(iter(fixed.files.values()), text.encode())
    return Outcome(fault, fixed, text, data.decode())


def _written(layer: Sdf.Layer, path: Path) -> Path:
    path.write_text(commented(layer.ExportToString()))
    return path


def _one_text(layer: Sdf.Layer, path: Path) -> Path:
    return _written(layer, path.with_suffix(".usda"))


def _one_binary(layer: Sdf.Layer, path: Path) -> Path:
    layer.Export(str(path), args={"format": "usdc"})
    return path


def _over(layer: Sdf.Layer) -> Sdf.Layer:
    """Return an empty layer with the units and axes of another."""
    root = Sdf.Layer.CreateAnonymous(".usda")
    for name in layer.pseudoRoot.ListInfoKeys():
        if name != "subLayers":
            root.pseudoRoot.SetInfo(name, layer.pseudoRoot.GetInfo(name))
    return root


def _graphs_in_sublayers(layer: Sdf.Layer, path: Path) -> Path:
    """Each graph in a sublayer of its own, all else in the weakest; the root says nothing."""
    root, scene, graphs = _over(layer), Sdf.Layer.CreateAnonymous(".usda"), list[Sdf.Path]()
    scene.TransferContent(layer)

    def collect(found: Sdf.Path) -> None:
        if found.IsPrimPath() and layer.GetPrimAtPath(found).typeName == "OmniGraph":
            graphs.append(found)

    layer.Traverse(Sdf.Path.absoluteRootPath, collect)
    for number, graph in enumerate(graphs):
        part = Sdf.Layer.CreateAnonymous(".usda")
        Sdf.CreatePrimInLayer(part, graph.GetParentPath() if graph.IsRootPrimPath() else graph)
        Sdf.CopySpec(layer, graph, part, graph)
        parent = scene.GetPrimAtPath(graph).nameParent or scene.pseudoRoot
        del parent.nameChildren[graph.name]
        name = f"graph{number}.usda"
        _written(part, path.with_name(name))
        root.subLayerPaths.append(name)
    _written(scene, path.with_name("scene.usda"))
    root.subLayerPaths.append("scene.usda")
    return _written(root, path.with_suffix(".usda"))


def _in_a_layer_elsewhere(layer: Sdf.Layer, path: Path) -> Path:
    """All in a sublayer of another folder, which no repair may edit."""
    root = _over(layer)
    aside = path.parent.parent / f"{path.parent.name}_shared"
    aside.mkdir(exist_ok=True)
    _written(layer, aside / "whole.usda")
    root.subLayerPaths.append(f"../{aside.name}/whole.usda")
    return _written(root, path.with_suffix(".usda"))


def _by_arcs(layer: Sdf.Layer, path: Path, kind: str) -> Path:
    root = _over(layer)
    _written(layer, path.with_name("whole.usda"))
    for prim in layer.rootPrims:
        over = Sdf.CreatePrimInLayer(root, prim.path)
        arcs = over.referenceList if kind == "reference" else over.payloadList
        arc = Sdf.Reference if kind == "reference" else Sdf.Payload
        arcs.prependedItems.append(arc("whole.usda", prim.path))
    return _written(root, path.with_suffix(".usda"))


def _by_references(layer: Sdf.Layer, path: Path) -> Path:
    return _by_arcs(layer, path, "reference")


def _by_payloads(layer: Sdf.Layer, path: Path) -> Path:
    return _by_arcs(layer, path, "payload")


def _in_variants(layer: Sdf.Layer, path: Path) -> Path:
    """What is below each prim at the root stands in a variant of it."""
    root = _over(layer)
    for prim in layer.rootPrims:
        Sdf.CopySpec(layer, prim.path, root, prim.path)
        above = root.GetPrimAtPath(prim.path)
        choice = Sdf.VariantSpec(Sdf.VariantSetSpec(above, "version"), "first")
        above.variantSelections["version"] = "first"
        above.variantSetNameList.prependedItems.append("version")
        for child in prim.nameChildren:
            Sdf.CopySpec(layer, child.path, root, choice.primSpec.path.AppendChild(child.name))
            del above.nameChildren[child.name]
    return _written(root, path.with_suffix(".usda"))


STRUCTURES: dict[str, Callable[[Sdf.Layer, Path], Path]] = {
    "text": _one_text,
    "binary": _one_binary,
    "sublayers": _graphs_in_sublayers,
    "elsewhere": _in_a_layer_elsewhere,
    "references": _by_references,
    "payloads": _by_payloads,
    "variants": _in_variants,
}


class Spread(NamedTuple):
    """A repaired stage of several files, what the check finds in the files, and its dry run.

    `wrong` is what is wrong in the dry run; empty where none was asked for. `same_at` are the
    checkpoints at which the same is found in every state of the stage, so that the repair is the
    same there.
    """

    fixed: Fixed
    after: tuple[Finding, ...]
    wrong: tuple[str, ...] = ()
    same_at: frozenset[str] = frozenset()

    @property
    def is_harmed(self) -> bool:
        """Whether an error is found that was not found before."""
        known = {site_of(finding) for finding in self.fixed.before}
        return any(
            finding.severity == "error" and site_of(finding) not in known for finding in self.after
        )


def repaired_in(
    structure: str,
    checkpoint: str,
    faults: Iterable[Fault],
    folder: Path,
    lab: Lab,
    *,
    drive: bool = False,
    others: Iterable[str] = (),
) -> Spread | None:
    """Repair a stage that has these faults and is spread over files in this way.

    None where the faults cannot be made, or are none. `others` are checkpoints of the same stage.
    """
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.TransferContent(second_stage(checkpoint))
    try:
        for fault in faults:
            fault.break_it(Usd.Stage.Open(layer))
    except (AttributeError, RuntimeError):  # the second author wrote something else there
        return None
    with tempfile.TemporaryDirectory(dir=folder) as own:
        inner = Path(own, "stage")
        inner.mkdir()
        file = f"{lab.checkpoints[checkpoint].file}.usd"
        path = STRUCTURES[structure](layer, inner / file)
        with judged_also(others) as same_at:
            fixed = fix_stage(path, checkpoint, lab, FixOptions(unsafe=True))
        if not has_errors(fixed.before):
            return None
        for written, data in fixed.files.items():
            written.write_bytes(data)
        after = fixed.judge_again(path)
        if after != fixed.after:  # what the files say is judged at each checkpoint then
            same_at = set()
        played = (checkpoint, *sorted(same_at)) if drive and not has_errors(after) else ()
        wrong = tuple(wrong_in_dry_runs(path, played, lab)) if played else ()
        return Spread(fixed, after, wrong, frozenset(same_at))


@contextmanager
def judged_also(others: Iterable[str]) -> Iterator[set[str]]:
    """Judge each state of a stage at other checkpoints too; yield those that found the same.

    The model is read once for all of them.
    """
    same = set(others)

    def judge_also(lab: Lab, spec: Checkpoint, model: StageModel) -> RuleResults:
        judged = judge(lab, spec, model)
        for other in sorted(same):
            there = judge(lab, lab.checkpoints[other], model)
            if (there.findings, there.crashes) != (judged.findings, judged.crashes):
                same.discard(other)
        return judged

    with patch.object(repairing, "judge", judge_also):
        yield same


_WRONG: dict[tuple[str, str, bool], tuple[str, ...]] = {}


def wrong_in_dry_runs(path: Path, checkpoints: Iterable[str], lab: Lab) -> Iterator[str]:
    """Yield what is wrong in the dry runs of a stage.

    What composes to the same is played once for all checkpoints that ask for the same, in whatever
    files it stands.
    """
    flat = Usd.Stage.Open(str(path)).Flatten()
    flat.documentation = ""  # which names the file
    composed = sha256(flat.ExportToString().encode()).hexdigest()
    for checkpoint in checkpoints:
        spec = lab.checkpoints[checkpoint]
        key = composed, repr(expected_at(lab, spec)), spec.localization
        if key not in _WRONG:
            checks = dry_run(path, lab, checkpoint).behaviour.checks
            _WRONG[key] = tuple(check.text for check in checks if check.verdict == "bad")
        yield from _WRONG[key]


def repaired_edit(number: int, folder: Path, lab: Lab) -> tuple[str, Fixed | None]:
    """Make and repair the edit of this number; nothing is repaired where it is no error.

    The stage is of some checkpoint and style; every third is binary, the others have comments.
    """
    chance = random.Random(number)  # noqa: S311 - the same on every run
    checkpoint, style = chance.choice(("02", "03", "05", "08")), chance.choice(STYLES)
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.TransferContent(second_stage(checkpoint, style))
    told = edit(Usd.Stage.Open(layer), number).text
    is_text = number % 3 > 0
    path = folder / f"edited{number}{'.usda' if is_text else '.usd'}"
    if is_text:
        path.write_text(commented(layer.ExportToString()))
    else:
        layer.Export(str(path), args={"format": "usdc"})
    fixed = fix_stage(path, checkpoint, lab, FixOptions(unsafe=True))
    path.unlink()
    return told, fixed if has_errors(fixed.before) else None


def has_errors(findings: Iterable[Finding]) -> bool:
    """Whether a stage with these findings fails."""
    return any(finding.severity == "error" for finding in findings)
