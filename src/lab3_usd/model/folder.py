"""A submission folder as plain data: maps, parameters, saved output, files.

Submissions, maps, parameters, saved output.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, Literal, TypeVar

from msgspec import Struct, field
from msgspec.structs import replace

from lab3_usd.model.dry_run import Check
from lab3_usd.model.finding import Problem, StageResult
from lab3_usd.spec.lab import FrameSpec, Lab
from lab3_usd.spec.ros import FROM_THE_FIRST, MapFacts, NavigationSpec, RosSpec
from lab3_usd.spec.submission import SubmissionSpec

Scalar = str | int | float | bool | None
# One ROS message, its fields by dotted path (`header.frame_id`, `status_list.0.status`).
Message = Mapping[str, Scalar]
SHOWN, ABOVE_ZERO = "shown", "above zero"  # what messages keep of an array, behind its name
Fact = TypeVar("Fact")


class Agreement(Struct, frozen=True):
    """How well map and walls agree, 0 to 1, for one guess of where the map's origin lies."""

    figure: float
    about: str


class MapSubject(Struct, frozen=True):
    """A map as handed in. `values` is the YAML file as read; None where it cannot be read.

    Paths are relative to the submission; `size` is (width, height) in cells. An absolute
    image path is looked for by its name beside the YAML; `image_file` is empty when it is not
    there, and when the path leads out of the submission. `image_format` is empty for a PGM, and
    where the file's ending tells it. `shared_walls` is the share of walls, 0 to 1, that it has in
    common with the grader's map, which has `replaced` one that was not handed in.
    """

    facts: MapFacts
    given: bool
    file: str
    values: Mapping[str, object] | None = None
    fault: str | None = None
    image_file: str = ""
    image_absolute: bool = False
    image_exists: bool = False
    image_fault: str | None = None
    image_format: str = ""
    size: tuple[int, int] | None = None
    agreements: tuple[Agreement, ...] = ()
    shared_walls: float | None = None
    replaced: bool = False


class Parameter(Struct, frozen=True):
    """One value of a parameter file: `node` and dotted `name` (`FollowPath.max_vel_x`)."""

    node: str
    name: str
    value: object
    line: int

    @property
    def last(self) -> str:
        """The last part of the name."""
        return self.name.rpartition(".")[2]

    @property
    def site(self) -> str:
        """The node and the whole name."""
        return f"{self.node}.{self.name}"

    @property
    def kind(self) -> str:
        """What ROS 2 takes the value for; empty where it is unknown."""
        if not isinstance(self.value, list):
            return kind_of(self.value)
        kinds = {kind_of(item) for item in self.value}
        return f"{kinds.pop()}_array" if len(kinds) == 1 and "" not in kinds else ""


_KINDS = ((bool, "bool"), (int, "integer"), (float, "double"), (str, "string"))


def kind_of(value: object) -> str:
    """Name the type of a single value as ROS 2 does; empty where it is unknown."""
    if isinstance(value, str) and "$(" in value:  # put in by the launch
        return ""
    return next((name for kind, name in _KINDS if isinstance(value, kind)), "")


class Refusal(Struct, frozen=True):
    """What the parameter parser of ROS 2 refuses: the name it stands at, and why."""

    name: str
    why: str
    line: int


class NavigationSubject(Struct, frozen=True):
    """A parameter file of Nav2 as handed in; `fault` says why it could not be read."""

    ros: RosSpec
    navigation: NavigationSpec
    frames: FrameSpec
    file: str
    parameters: tuple[Parameter, ...] = ()
    refusals: tuple[Refusal, ...] = ()
    fault: str | None = None


@dataclass(frozen=True, slots=True)
class Observation(Generic[Fact]):
    """A fact and the file that shows it, relative to the submission."""

    fact: Fact
    file: str


class ListedEndpoint(Struct, frozen=True):
    """A publisher or subscription of a topic, its policies as `ros2 topic info --verbose` says."""

    node: str
    publishes: bool
    type: str = ""
    reliability: str = ""
    durability: str = ""


class Lookup(Struct, frozen=True):
    """What `tf2_echo` printed: whether it found the transform, and the last translation (m)."""

    found: bool
    translation: tuple[float, float, float] | None = None


class GoalRun(Struct, frozen=True):
    """One navigation goal: its status number, and how long it took in seconds when measured."""

    status: int
    seconds: float | None = None


class RecordingShown(Struct, frozen=True):
    """The contents of a recording of the running system, and the checks of it.

    `unread` says why it was not read; `for_lack` that it lacks an extra of this program.
    """

    file: str
    topics: frozenset[str] = frozenset()
    frames: frozenset[str] = frozenset()
    checks: tuple[Check, ...] = ()
    unread: str = ""
    for_lack: bool = False

    def shows(self, kind: str, target: str) -> bool:
        """Whether it shows what a command of this kind prints about its target."""
        if kind == "topic_list":
            return bool(self.topics)
        if kind in {"topic_type", "topic_hz", "topic_echo", "topic_info"}:
            return target in self.topics
        return kind in {"view_frames", "tf2_echo"} and {*target.split()} < self.frames


class Run(Struct, frozen=True):
    """One line of the manifest: what was run, how it ended, when it began, how long it took."""

    file: str
    exit: int
    start: str
    seconds: float
    command: str


GOAL = "goal"  # the check of a recording that a goal was reached
Edge = tuple[str, str]
Outputs = Mapping[str, tuple[Observation[Fact], ...]]


class Evidence(Struct, frozen=True):
    """What a folder of saved outputs shows, by kind of command and by what each was about.

    The names of the outputs are those of the kinds in `ros.yaml`; `listed_type` are the types
    that lists and infos name, `topic_hearers` how many subscribe. The keys are a topic, a node,
    or two frames; for lists, trees and goals the key is empty.
    """

    folder: str
    topic_list: Outputs[tuple[str, ...]] = field(default_factory=dict)
    node_list: Outputs[tuple[str, ...]] = field(default_factory=dict)
    topic_type: Outputs[tuple[str, ...]] = field(default_factory=dict)
    topic_hz: Outputs[float] = field(default_factory=dict)
    topic_echo: Outputs[Message] = field(default_factory=dict)
    topic_info: Outputs[tuple[ListedEndpoint, ...]] = field(default_factory=dict)
    listed_type: Outputs[tuple[str, ...]] = field(default_factory=dict)
    topic_hearers: Outputs[int] = field(default_factory=dict)
    lifecycle: Outputs[str] = field(default_factory=dict)
    tf2_echo: Outputs[Lookup] = field(default_factory=dict)
    view_frames: Outputs[tuple[Edge, ...]] = field(default_factory=dict)
    packages: Outputs[tuple[str, ...]] = field(default_factory=dict)
    goals: Outputs[GoalRun] = field(default_factory=dict)
    runs: tuple[Run, ...] = ()
    recordings: tuple[RecordingShown, ...] = ()


class EvidenceSubject(Struct, frozen=True):
    """Saved diagnostics beside what they must show by the checkpoints that were reached.

    With `required`, evidence that is missing is an error instead of a note. Of a folder that is
    not `handed_in` it is not asked.
    """

    ros: RosSpec
    frames: FrameSpec
    facts: MapFacts | None
    evidence: Evidence
    reached: tuple[str, ...]
    required: bool = False
    handed_in: bool = True

    def asks_from(self, since: str) -> bool:
        """Whether what holds from a checkpoint on must be shown."""
        return since == FROM_THE_FIRST or since in self.reached


def judge_best(
    shown: Sequence[Observation[Fact]], judge: Callable[[Observation[Fact]], Iterable[Problem]]
) -> list[Problem]:
    """Judge every output of one command and return what is wrong with the best of them.

    A fault that a later output shows repaired is no fault; of equals the last one counts. Where a
    later one has a fault that it lacks, a note says so.
    """
    judged = [([*judge(observation)], number) for number, observation in enumerate(shown)]
    problems, best = min(reversed(judged), key=lambda each: len(each[0]), default=([], 0))
    later = [files[-1] for files, number in judged if files and number > best]
    if problems or not later:
        return problems
    message = f"{later[-1].message}; {shown[best].file} shows it right"
    return [replace(later[-1], message=message, severity="note", fix=(), unmet=())]


_RECORDING_ENDINGS = (".mcap", ".db3", ".mcap.zstd", ".db3.zstd")


class FolderFile(Struct, frozen=True):
    """A file of the folder, by its path in it; `why_not` says why it is never opened."""

    path: str
    why_not: str = ""

    @property
    def name(self) -> str:
        """The name of the file."""
        return self.path.rpartition("/")[2]

    @property
    def folder(self) -> str:
        """The path of the folder that holds it, '' for the submission itself."""
        return self.path.rpartition("/")[0]

    @property
    def is_recording(self) -> bool:
        """Whether the file is a recording of ROS 2, or a part of one, by its name."""
        return self.name.endswith(_RECORDING_ENDINGS)


class StageFile(Struct, frozen=True):
    """The file that stands for one checkpoint, and how it is named.

    `slip` is a file that ends in what is no ending of USD. `others` are files with the same
    right name and another ending, `more` files elsewhere or of other names that seem to be of the
    same checkpoint.
    """

    checkpoint: str
    path: str
    naming: Literal["right", "misplaced", "misnamed", "slip"] = "right"
    others: tuple[str, ...] = ()
    more: tuple[str, ...] = ()


class StarterFile(Struct, frozen=True):
    """The starter in the submission: why it cannot be opened, or what of the lab it holds."""

    path: str
    fault: str = ""
    holds: tuple[str, ...] = ()


class Listing(Struct, frozen=True):
    """The files of a folder in the order of their paths.

    `stages` are by checkpoint, the paths of `deliverables` by name. `stage_folder` holds the
    stages, '' for the submission itself; `complete` is False if there were too many files to list.
    """

    entries: tuple[FolderFile, ...]
    stage_folder: str = ""
    stages: Mapping[str, StageFile] = field(default_factory=dict)
    starter: str | None = None
    deliverables: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    complete: bool = True


class UnjudgedStage(Struct, frozen=True):
    """A stage file of no checkpoint, and the checkpoint that its content fits, '' for none."""

    path: str
    checkpoint: str = ""


class SubmissionSubject(Struct, frozen=True):
    """A submission: its files, and the results of its stages by checkpoint.

    `digests` tell files apart, by checkpoint; `starter` is None where there is none. `unjudged` are
    stage files that nothing refers to. What is missing in a folder that is not `handed_in` is still
    to come.
    """

    lab: Lab
    spec: SubmissionSpec
    listing: Listing
    results: Mapping[str, StageResult]
    digests: Mapping[str, str]
    starter: StarterFile | None = None
    unjudged: tuple[UnjudgedStage, ...] = ()
    handed_in: bool = True
