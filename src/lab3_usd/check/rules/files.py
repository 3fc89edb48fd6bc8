"""Rules about files: the stage, its sublayers and assets, and what a grader does not open."""

from __future__ import annotations

import reprlib
from collections.abc import Iterable, Iterator
from pathlib import PurePath
from typing import TYPE_CHECKING

from lab3_usd.check.match.rule_inputs import ModelSubject, StageSubject
from lab3_usd.check.registry import rule
from lab3_usd.isaac.values import SAVED, same_numbers
from lab3_usd.model.finding import MOST_ITEMS, MOST_LETTERS, IgnoreNote, Problem
from lab3_usd.model.prims import is_at_or_below

if TYPE_CHECKING:
    from lab3_usd.model.dry_run import Check


@rule("F01", "unreadable-file", scope="file")
def unreadable_file(reason: str) -> Iterator[Problem]:
    """The file cannot be opened as a USD stage.

    Why: Isaac Sim cannot open it either, and nothing in it can be judged.

    Fix: correct the line that is named in a text editor. Else go back to an older copy of the file,
    or open the stage of the checkpoint before, repeat this part, and save it under this name.

    Example: a file that ends in `.uda`, or an upload that was cut short.
    """
    yield Problem("/", reason, unopened="stage")


@rule(
    "F02",
    "not-verifiable",
    scope="model",
    severity="note",
    counted=("asset not found", "assets not found"),
)
def not_verifiable(subject: ModelSubject) -> Iterator[Problem]:
    """An asset that the stage refers to cannot be found.

    Why: the asset may exist on the computer where the stage was made. What it holds is neither
    passed nor failed. Graphs, nodes and connections must be in the stage itself.

    Fix: keep the asset beside the stage, with a relative path, or choose File > Collect As in Isaac
    Sim. Assets on NVIDIA's own server need no action. `--assets` names the folder in which a
    server's assets lie on this computer.

    Example: a sensor refers to a file on a server.
    """
    users: dict[tuple[str, str], list[str]] = {}
    for missing in subject.stage.unresolved:
        if missing.kind not in ("sublayer", "script"):
            of = PurePath(missing.layer).name if missing.kind == "sublayer of an asset" else ""
            users.setdefault((missing.asset, of), []).append(missing.prim)
    for (asset, of), (first, *more) in users.items():
        what = f"the sublayer {asset} of {of}" if of else asset
        message = (
            f"not verifiable: {what} cannot be found, so its content at {first} neither passes "
            "nor fails"
        )
        needed = ((first, "asset"),)  # what a lab asks for must be there
        yield Problem(
            first, message, actual=asset, related=tuple(more), unopened="asset", assumes=needed
        )


@rule(
    "F03", "missing-sublayer", scope="model", counted=("sublayer not found", "sublayers not found")
)
def missing_sublayer(subject: ModelSubject) -> Iterator[Problem]:
    """A sublayer of the stage cannot be found.

    Why: the sublayer could hold anything, so the stage is not the one that was worked on. Prims
    that it may hold are not reported one by one. Missing graphs are reported.

    Fix: keep the sublayer beside the stage, with a relative path, or open the stage in Isaac Sim
    and choose File > Save Flattened As.

    Example: `subLayers = [@/home/ana/{stages}/edits.usda@]`.
    """
    for missing in subject.stage.unresolved:
        if missing.kind == "sublayer":
            message = f"sublayer {missing.asset} cannot be found"
            yield Problem("/", message, actual=missing.asset, unopened="file")


@rule("F04", "muted-sublayer", scope="stage", severity="warning")
def muted_sublayer(subject: StageSubject) -> Iterator[Problem]:
    """A muted sublayer holds parts of the lab.

    Why: Isaac Sim stores the list of muted layers in the stage and opens the stage without them. On
    another computer the content of these layers is missing. The check judges the stage as if no
    layer were muted.

    Fix: open Window > Layer, click the eye of the layer named here to unmute it, and save.

    Example: `{next_graph_name}` is in `part.usda`, which is muted.
    """
    for muted in subject.stage.muted:
        parts = _lab_parts(subject, muted.prims)
        if parts:
            message = f"sublayer {muted.asset} is muted and holds {', '.join(parts)}"
            yield Problem("/", message, actual=muted.asset, related=parts)


@rule("F06", "unused-ignore", scope="file", severity="warning")
def unused_ignore(unused: tuple[IgnoreNote, str]) -> Iterator[Problem]:
    """A suppression in the stage silences no finding.

    Why: the fault is repaired, or the suppression is misplaced or misspelt. One that stays hides
    the next fault of this kind.

    Fix: remove it, or correct the rule that it names. A comment `# lab3: ignore[W05]` is
    about its own line, or alone on a line about the next one. `lab3:ignore` in the custom data of
    a prim is about the prim and everything below it.

    Example: `# lab3: ignore[P02]` at a value that is right.
    """
    note, reason = unused
    yield Problem(
        note.prim or "/",
        f"ignore[{note.rule}] ignores nothing: {reason}",
        note.property,
        actual=note.rule or None,
    )


def _lab_parts(subject: StageSubject, prims: Iterable[str]) -> tuple[str, ...]:
    """Return the parts of the lab that these prims belong to: graphs, sensors, the robot."""
    scene, graphs = subject.lab.scene, subject.lab.graphs
    robots = (robot.path for robot in scene.robots)
    parts = [*robots, *(sensor.path for sensor in scene.sensors.values())]
    parts += [graphs[name].path for name in subject.checkpoint.graphs]
    parts += [roles.graph.path for roles in subject.roles.values() if roles.graph is not None]
    owners = (max((p for p in parts if is_at_or_below(prim, p)), default="") for prim in prims)
    return tuple(sorted({owner for owner in owners if owner}))


@rule("F07", "only-in-a-dry-run", scope="file", severity="note")
def only_in_a_dry_run(fault: Check) -> Iterator[Problem]:
    """A dry run shows a fault that no rule finds.

    Why: rules compare what is saved, a dry run drives the robot. Some faults come from several
    values that are each allowed, or from numbers that the handout leaves open.

    Fix: run `lab3 sim` on the stage. It names the prim at fault, and its page draws what the robot
    does.

    Example: {wheels?}the robot drifts to the side, as its wheels are not on one axle{else}a joint
    stops before the place to which it is commanded{/}.
    """
    yield Problem(fault.prim or "/", f"in a dry run ({fault.name}): {fault.text}")


@rule("Z01", "file-left-out", scope="file")
def file_left_out(path: str, reason: str) -> Iterator[Problem]:
    """A file was not opened.

    Why: links, pipes and devices reach out of a submission, and damaged, encrypted or very large
    files cannot be judged. The rest of the submission is still judged.

    Fix: hand in plain files, in a folder or a .zip archive without a password.

    Example: `{stages}/{stage3}` is a symbolic link to a file in somebody's home.
    """
    yield Problem(path, f"this file is left out: {reason}", unopened="file")


@rule("Z02", "reference-left-out", scope="file")
def reference_left_out(asset: str, reason: str) -> Iterator[Problem]:
    """A stage refers to a file outside the submission.

    Why: a stage is judged by the files that were handed in. Files elsewhere are not opened, and a
    graph in a missing file cannot be judged.

    Fix: keep the graphs in the stage itself, and hand in assets beside it, with relative paths that
    stay inside the submission. File > Collect As in Isaac Sim does that.

    Example: `references = @../../solution/{stage3}@`.
    """
    yield Problem("/", f"{asset} is not opened: {reason}", actual=asset, unopened="file")


@rule("Z03", "folder-left-aside", scope="file", severity="warning")
def folder_left_aside(path: str, choice: str) -> Iterator[Problem]:
    """The upload contains several possible submissions.

    Why: only one of them is judged: the one with the most readable checkpoints, then the newest,
    then the shallowest. Stages in the others earn nothing.

    Fix: hand in one folder, without backups and copies. If the wrong one was judged, hand in the
    right one alone, or tell your instructor.

    Example: `Backup/{stages}` beside `Lab3/{stages}`.
    """
    yield Problem(path, choice)


@rule("Z04", "upload-left-aside", scope="file", severity="warning")
def upload_left_aside(path: str, uploads: str) -> Iterator[Problem]:
    """An earlier upload has more.

    Why: the last upload is the submission. If an earlier one holds more checkpoints, work may have
    been forgotten in the last one. If the grader merges uploads, the finding names the upload of
    each file.

    Fix: upload all files again, together.

    Example: the first upload holds all stages, the last one only the one that was corrected.
    """
    yield Problem(path, uploads)


@rule("Z05", "file-passed-over", scope="file", severity="note")
def file_passed_over(path: str, reason: str) -> Iterator[Problem]:
    """A file is not part of the judged submission.

    Why: folders that version control, environments and builds fill (`.git`, `venv`, `build`,
    `install`, `log`, `__pycache__`) hold nothing of the lab, unless stages lie in them. Files
    outside of the judged folder are not examined.

    Fix: nothing, if the file or folder does not matter. Else put it into the folder of the lab,
    under another name.

    Example: the `install` of a colcon workspace.
    """
    yield Problem(path, f"passed over: {reason}")


_DEEPEST = 3


def is_equal(actual: object, expected: object) -> bool:
    """Whether a value, or each of a list, that was read is the one that is asked for."""
    if isinstance(actual, (list, tuple)) and isinstance(expected, (list, tuple)):
        return len(actual) == len(expected) and all(map(is_equal, actual, expected))
    if isinstance(actual, (int, float)) and isinstance(expected, (int, float)):
        return same_numbers([actual], [expected], SAVED)
    return actual == expected


def shortened(value: object) -> str:
    """Return a value of a YAML file or a message, as YAML writes it, and not too long to read."""
    if isinstance(value, (list, tuple, dict)):
        return _repr.repr(value)
    text = str(value).lower() if isinstance(value, bool) else str(value)
    return text if len(text) <= MOST_LETTERS else f"{text[:MOST_LETTERS]}..."


def _shortening() -> reprlib.Repr:
    made = reprlib.Repr()
    made.maxlevel = _DEEPEST
    made.maxlist = made.maxtuple = made.maxdict = MOST_ITEMS
    made.maxstring = made.maxother = made.maxlong = MOST_LETTERS
    return made


_repr = _shortening()
