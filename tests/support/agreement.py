"""What five commands say of one stage, and where two of them contradict each other."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import quick_yaml
from breaking import broken, correct_stage, the_lab
from fault_stages import STAGES
from in_process import invoke
from linting import broken_robot
from menu_graphs import MENUS, with_menus
from msgspec import Struct
from places import REPOSITORY, SHARED, TESTS
from pxr import Usd
from robot_kinds import KINDS
from two_judges import all_faults, known_rows

CHECKPOINT = "05"
Make = Callable[[], Usd.Stage]


def _table(name: str) -> dict[str, Any]:
    table: dict[str, Any] = quick_yaml.load((TESTS / f"{name}.yaml").read_text(encoding="utf-8"))
    return table


CONTRADICTORY = _table("contradictions")


class Subject(NamedTuple):
    """A stage: made, or a file; without a checkpoint it is not the lab's."""

    name: str
    make: Make | Path
    checkpoint: str = ""


def contradictions_of(subject: Subject, drive: str = "") -> list[Contradiction]:
    """Ask all commands about one stage, whose robots are driven as `drive` says."""
    make, checkpoint = subject.make, subject.checkpoint
    try:
        if isinstance(make, Path):
            said = answers(make, checkpoint, drive)
        else:
            said = answers_of(make(), checkpoint, drive)
    except NoAnswerError as error:
        return [Contradiction("crashes", str(error), subject.name)]
    return contradictions(said, subject.name)


@cache
def all_subjects() -> tuple[Subject, ...]:
    return (
        *_of_the_lab(),
        *_of_rules(),
        *_of_others(),
        *_files(),
    )


def once_contradictory() -> tuple[Subject, ...]:
    """Return the stages of tests/contradictions.yaml."""
    return tuple(
        Subject(name, _case(case), case.get("checkpoint", ""))
        for name, case in CONTRADICTORY["stages"].items()
    )


def _case(case: dict[str, Any]) -> Make | Path:
    if "file" in case:
        return REPOSITORY / case["file"]
    if "checkpoint" in case:
        return partial(broken, case["checkpoint"], case["steps"])
    return partial(broken_robot, case["robot"], case["steps"])


def _of_the_lab() -> Iterator[Subject]:
    for number in the_lab().checkpoints:
        yield Subject(f"built {number}", partial(correct_stage, number), number)
    for kind, (change, _) in STAGES.items():
        yield Subject(f"fault stage: {kind}", partial(_changed, change), CHECKPOINT)
    for fault in all_faults():
        yield Subject(f"sweep: {fault.name}", partial(_changed, fault.break_it), CHECKPOINT)


def _changed(change: Callable[[Usd.Stage], None]) -> Usd.Stage:
    stage = correct_stage(CHECKPOINT)
    change(stage)
    return stage


def _cases(folder: str) -> Iterator[tuple[str, Any, Any, list[dict[str, Any]]]]:
    """Yield the steps of the case files: what triggers a rule, and what only looks like it."""
    for path in sorted((TESTS / folder).glob("*.yaml")):
        case = quick_yaml.load(path.read_text(encoding="utf-8"))
        for name, entry in {"": case, **case.get("more", {})}.items():
            yield f"{path.stem} {name}".strip(), case, entry, entry["break"]
        for name, entry in {"clear": case["clear"], **case.get("alike", {})}.items():
            known = entry if isinstance(entry, dict) else {"steps": entry}
            yield f"{path.stem} {name}", case, known, known["steps"]


def _of_rules() -> Iterator[Subject]:
    for name, case, entry, steps in _cases("cases"):
        checkpoint = entry.get("checkpoint", case.get("checkpoint", CHECKPOINT))
        yield Subject(f"case: {name}", partial(broken, checkpoint, steps), checkpoint)
    for name, case, entry, steps in _cases("lint_cases"):
        robot = entry.get("robot", case.get("robot", "rover"))
        yield Subject(f"lint case: {name}", partial(broken_robot, robot, steps))


def _of_others() -> Iterator[Subject]:
    for name, make in KINDS.items():
        yield Subject(f"robot: {name}", make)
    for name, seed in _table("robot_faults").items():
        make = partial(broken_robot, seed["robot"], seed["break"])
        yield Subject(f"fault: {name}", make)
    for name in MENUS:
        yield Subject(f"menu: {name}", partial(with_menus, name))
    for name, case in _table("lint_legal").items():
        known = case if isinstance(case, dict) else {"steps": case}
        make = partial(broken_robot, known.get("robot", "rover"), known["steps"])
        yield Subject(f"legal: {name}", make)
    for name, robots in _table("lint_faults").items():
        for robot, seed in robots.items():
            yield Subject(f"fault: {name} ({robot})", partial(broken_robot, robot, seed["break"]))


def _files() -> Iterator[Subject]:
    for path in sorted((REPOSITORY / "docs" / "examples").glob("*.usd*")):
        yield Subject(f"example: {path.name}", path)
    for path in sorted((SHARED / "corpus").rglob("*.usd*")):
        if "payloads" not in path.parts:
            yield Subject(f"corpus: {path.stem}", path)


FOUND = ("error", "warning")
CHECK, LINT, SIM, TF, TOPICS = "check", "lint", "sim", "tf", "topics"
# Rules of a lab, and rules that need none, that answer one question of one prim.
SAME_AT_A_PRIM: tuple[tuple[frozenset[str], frozenset[str]], ...] = tuple(
    (frozenset(of_lab.split()), frozenset(of_any.split()))
    for of_lab, of_any in (
        ("G06", "K07"),
        ("W03 W11", "K20 K21"),
        ("W04", "K24"),
        ("W08", "K23"),
        ("W09", "K22"),
        ("N06", "K31"),
        ("N09", "K05"),
        ("P03", "K34"),
        ("P11", "K63"),
        ("T11", "K55"),
    )
)
# The same of a whole stage, with what `lab3 tf` says.
SAME_OF_A_STAGE: Mapping[str, frozenset[str]] = {
    "a frame has several parents": frozenset({"T03", "K50", "two parents"}),
    "a transform comes from several publishers": frozenset({"T04", "K54", "published twice"}),
    "frames form a cycle": frozenset({"T05", "T09", "K51", "K52", "own parent", "ring"}),
    "a topic has several publishers": frozenset({"Q01", "K40"}),
    "a topic has several types": frozenset({"Q02", "K41"}),
    "moving transforms are sent as static ones": frozenset({"Q03", "K57"}),
}
APART = frozenset({"K53", "several roots"})  # the rules of a lab ask for its root
RATE = re.compile(r"sensor at ([\d.e+-]+) Hz")


class Answers(Struct, frozen=True):
    """The documents that the commands print of one stage; `check` and `drive` need a checkpoint.

    `play` is a dry run that asks nothing of a lab.
    """

    lint: Mapping[str, Any]
    play: Mapping[str, Any]
    tf: Mapping[str, Any]
    topics: Mapping[str, Any]
    check: Mapping[str, Any] | None = None
    drive: Mapping[str, Any] | None = None


class NoAnswerError(Exception):
    """A command says nothing of a stage, because it fails itself."""


def answers(path: Path, checkpoint: str, drive: str = "") -> Answers:
    """Ask the commands; the name of the file names no checkpoint.

    The robots drive as `drive` says: a few faults show in the whole fixed drive alone.
    """
    at, how = ("--checkpoint", checkpoint), ("--drive", drive) if drive else ()
    return Answers(
        lint=_asked(LINT, path)["results"][0],
        play=_asked(SIM, path, *how),
        tf=_asked(TF, path),
        topics=_asked(TOPICS, path),
        check=_asked(CHECK, path, *at)["results"][0] if checkpoint else None,
        drive=_asked(SIM, path, *at, *how) if checkpoint else None,
    )


def answers_of(stage: Usd.Stage, checkpoint: str, drive: str = "") -> Answers:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "stage.usdc"
        stage.GetRootLayer().Export(str(path))
        return answers(path, checkpoint, drive)


def _asked(command: str, path: Path, *arguments: str) -> Any:
    try:
        given = invoke(command, path, "--format", "json", *arguments)
    except Exception as error:  # a bug of any kind, which is counted
        raise NoAnswerError(f"{command} ends in {type(error).__name__}: {error}") from error
    if given.exit_code not in (0, 1):
        raise NoAnswerError(f"{command} ends with {given.exit_code}: {given.output}")
    return json.loads(given.stdout)


class Contradiction(NamedTuple):
    """Two answers to one question about a stage that cannot both be right."""

    question: str
    answers: str
    stage: str

    def __str__(self) -> str:
        return f"{self.question}: {self.answers} [{self.stage}]"


def contradictions(said: Answers, stage: str) -> list[Contradiction]:
    """Return where the commands contradict each other."""
    return [
        Contradiction(question, text, stage)
        for question, compare in QUESTIONS.items()
        for text in dict.fromkeys(compare(said))
    ]


def unexplained(said: Iterable[Contradiction]) -> list[Contradiction]:
    """Return those that no row of the table is about."""
    rows = known_rows("answers")
    return [each for each in said if not any(row.holds(str(each)) for row in rows)]


def found(result: Mapping[str, Any] | None, *severities: str) -> list[Mapping[str, Any]]:
    """Return the findings of a report; without severities the errors and warnings."""
    findings = () if result is None else result["findings"]
    return [each for each in findings if each["severity"] in (severities or FOUND)]


def failed(run: Mapping[str, Any] | None) -> list[Mapping[str, Any]]:
    return [each for each in (run or {}).get("checks", ()) if each["verdict"] == "bad"]


def published_topics(said: Answers) -> Iterator[str]:
    """Which topics does a message come on, in which domain and of which type?"""
    sending = [e for e in said.topics["topics"] if e["direction"] == "publishes" and e["runs"]]
    sent = {(e["domain"], e["name"]): e for e in said.play["topics"]}
    for (domain, topic), message in sent.items():
        here = (e for e in sending if e["topic"] == topic and e["domain"] in {domain, None})
        types = {e["type"] for e in here}  # that of a context of an unknown type may be any
        if not types:
            yield f"sim sends {topic} in domain {domain}, topics has no such topic"
        elif message["type"] not in types and None not in types:
            yield f"sim sends {message['type']} on {topic}, topics says {sorted(types)}"
    told = {each["prim"] for each in found(said.lint)} | unsimulated(said.play)
    told |= {path for each in found(said.lint) for path in each["related"]}
    told |= {end["node"] for end in sending if is_open(said, end["node"])}
    for end in sending:
        is_sent = any(
            topic == end["topic"] and end["domain"] in {domain, None} for domain, topic in sent
        )
        is_lost = end["sure"] and end["topic"] and not is_sent and end["node"] not in told
        if is_lost and not is_explained(said, end["node"]):
            yield f"topics says {end['node']} publishes {end['topic']}, sim receives nothing"


def is_open(said: Answers, node: str) -> bool:
    """Whether the dry run says itself that it does not know what a node does."""
    checks = [each for each in said.play["checks"] if each["verdict"] == "not judged"]
    return any(node in each["message"] for each in checks)


def unsimulated(run: Mapping[str, Any]) -> set[str]:
    return {each["prim"] for each in run["not_simulated"]}


def explained(said: Answers, check: Mapping[str, Any]) -> bool:
    """Whether lint reports the rule that a failed check names."""
    return check["rule"] in {each["rule"] for each in said.lint["findings"]}


def is_explained(said: Answers, node: str) -> bool:
    """Whether the dry run says of a node that it fails, for a reason that lint reports."""
    return any(explained(said, each) for each in failed(said.play) if node in each["message"])


def nodes_that_run(said: Answers) -> Iterator[str]:
    """Does a publisher or subscriber run?"""
    graphs = {prim.rpartition("/")[0] for prim in sites(said.lint["findings"])}
    graphs |= sites(said.lint["findings"])
    idle = {each["prim"] for each in said.lint["findings"] if each["rule"] == "K01"}
    for end in said.topics["topics"]:
        node = end["node"]
        is_said = node.rpartition("/")[0] in graphs or is_explained(said, node)
        if not end["runs"] and not is_said:
            yield f"topics says {node} never runs, lint has nothing in its graph"
        if end["runs"] and end["sure"] and node in idle:
            yield f"lint says {node} never runs, topics says it does"


def topic_rates(said: Answers) -> Iterator[str]:
    """How often does a message come?"""
    rates = {(each["domain"], each["name"]): each["hz"] for each in said.play["topics"]}
    ends: dict[tuple[int, str], list[Mapping[str, Any]]] = {}
    for end in said.topics["topics"]:
        if end["direction"] == "publishes" and end["runs"]:
            ends.setdefault((end["domain"], end["topic"]), []).append(end)
    for key, (first, *others) in ends.items():
        rate = RATE.fullmatch(first["rate"])
        hz = rates.get(key)
        if rate and hz and not others and abs(hz - float(rate[1])) > 0.05 * hz + 0.2:
            yield f"topics says {first['topic']} comes from a {first['rate']}, sim counts {hz} Hz"


def transforms(said: Answers) -> Iterator[str]:
    """Which transforms are sent?"""
    edges = said.tf["transforms"]
    sure = {(e["parent"], e["child"], e["static"]) for e in edges if e["sure"]}
    perhaps = {(e["parent"], e["child"], e["static"]) for e in edges}
    sent = {(e["parent"], e["child"], e["static"]) for e in said.play["frames"]}
    if not said.tf["unknown_publishers"]:
        for parent, child, _ in sorted(sent - perhaps):
            yield f"sim sends {parent} -> {child}, tf has no such transform"
    told = {each["prim"] for each in found(said.lint)} | unsimulated(said.play)
    for edge in edges:
        key = (edge["parent"], edge["child"], edge["static"])
        is_told = {edge["publisher"], edge["cause"]} & told or is_open(said, edge["publisher"])
        if key in sure - sent and not is_told:
            yield f"tf has {edge['parent']} -> {edge['child']}, sim receives no such transform"


def stage_facts(said: Answers) -> Iterator[str]:
    """Is TF one tree; has a topic one publisher and one type?"""
    rules = {command: {e["rule"] for e in found(report)} for command, report in reports(said)}
    drawn = {each["kind"] for each in said.tf["problems"]}
    for run, of in ((said.play, LINT), (said.drive, CHECK)):
        rules[f"{SIM} beside {of}"] = {each["rule"] for each in failed(run)}
    for fact, same in SAME_OF_A_STAGE.items():
        says = {command: bool(ids & same) for command, ids in rules.items()}
        if said.check is not None and says[CHECK] != says[LINT]:
            yield contrary(fact, CHECK, LINT, says[CHECK])
        if fact.startswith(("a frame", "a transform", "frames")):
            if bool(drawn & same) != says[LINT]:
                yield contrary(fact, TF, LINT, bool(drawn & same))
            if said.check is not None and bool(drawn & same) != says[CHECK]:
                yield contrary(fact, TF, CHECK, bool(drawn & same))
    most = max((len(tree["roots"]) for tree in said.tf["trees"]), default=0)
    roots = most > max(1, len(said.play["robots"]))
    # Two parents of a frame are two roots as well, of one tree.
    if roots != bool(rules[LINT] & APART) and not (said.tf["unknown_frames"] or drawn):
        yield contrary("there are several trees", TF, LINT, roots)


def contrary(fact: str, one: str, other: str, is_so: bool) -> str:  # noqa: FBT001
    says, denies = (one, other) if is_so else (other, one)
    return f"{says} says that {fact}, {denies} does not"


def reports(said: Answers) -> Iterator[tuple[str, Mapping[str, Any]]]:
    yield LINT, said.lint
    if said.check is not None:
        yield CHECK, said.check


def same_rules(said: Answers) -> Iterator[str]:
    """What does a rule that is true without a lab say of a prim?"""
    if said.check is None:
        return
    for of_lab, of_any in SAME_AT_A_PRIM:
        for one, other, ids, name in (
            (said.check, said.lint, of_lab, LINT),
            (said.lint, said.check, of_any, CHECK),
        ):
            prims = sites(other["findings"])
            for finding in found(one):
                if finding["rule"] in ids and finding["prim"] not in prims:
                    yield f"{finding['severity']} {finding['rule']}, {name} has nothing there"


def sites(findings: Any) -> set[str]:
    """Return the prims that findings name."""
    related = {path.partition(".")[0] for each in findings for path in each["related"]}
    return related | {each["prim"] for each in findings}


def severities(said: Answers) -> Iterator[str]:
    """How grave is a fault of a wire or value?"""
    for of_lab, of_any in SAME_AT_A_PRIM if said.check is not None else ():
        lint = {(e["prim"], e["property"]): e for e in found(said.lint) if e["rule"] in of_any}
        for each in found(said.check):
            other = lint.get((each["prim"], each["property"])) if each["rule"] in of_lab else None
            if other is not None and other["severity"] != each["severity"]:
                one, two = (f"{e['severity']} {e['rule']}" for e in (each, other))
                yield f"check says {one}, lint {two}"


def named_rules(said: Answers) -> Iterator[str]:
    """Does the rule that explains a failed dry run find its fault?"""
    yield from _unreported(said.play, said.lint, LINT)


def named_rules_of_a_lab(said: Answers) -> Iterator[str]:
    """Does the rule of the lab that explains a failed dry run find its fault?"""
    if said.check is not None:
        yield from _unreported(said.drive, said.check, CHECK)


def _unreported(
    run: Mapping[str, Any] | None, report: Mapping[str, Any], command: str
) -> Iterator[str]:
    rules = {each["rule"] for each in report["findings"]}
    for check in failed(run):
        if check["rule"] and check["rule"] not in rules:
            yield f"sim: {check['name']} names {check['rule']}, {command} does not report it"


def unnamed_rules(said: Answers) -> Iterator[str]:
    """Does a failed dry run name a rule, where the rules find an error as well?"""
    for run, (command, report) in zip((said.play, said.drive), reports(said), strict=False):
        errors = sorted({each["rule"] for each in found(report, "error")})
        for check in failed(run):
            if errors and not check["rule"]:
                yield f"{command} has error {errors[0]}, sim fails ({check['name']}) by no rule"


def runs(said: Answers) -> Iterator[str]:
    """Does the stage work?"""
    unknown = unsimulated(said.play)  # of which sim says itself that it says nothing
    errors = [each for each in found(said.lint, "error") if each["prim"] not in unknown]
    if failed(said.play) and not found(said.lint):
        names = ", ".join(each["name"] for each in failed(said.play))
        yield f"sim fails ({names}), lint finds nothing"
    if said.play["verdict"] == "ok" and errors:
        yield f"lint has error {errors[0]['rule']}, sim is all ok"


def passes(said: Answers) -> Iterator[str]:
    """Does a stage of the lab pass?"""
    if said.check is None or said.drive is None:
        return
    errors = found(said.check, "error")
    if not errors and found(said.lint, "error"):
        yield f"check passes, lint has error {found(said.lint, 'error')[0]['rule']}"
    if not errors and failed(said.drive):
        yield f"check passes, sim fails ({failed(said.drive)[0]['name']})"


QUESTIONS: Mapping[str, Callable[[Answers], Iterator[str]]] = {
    "topics": published_topics,
    "nodes": nodes_that_run,
    "rates": topic_rates,
    "transforms": transforms,
    "stage facts": stage_facts,
    "same rules": same_rules,
    "severities": severities,
    "named rules": named_rules,
    "named rules of a lab": named_rules_of_a_lab,
    "unnamed rules": unnamed_rules,
    "runs": runs,
    "passes": passes,
}
