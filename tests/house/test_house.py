"""Rules that the repository keeps about itself and that no linter knows."""

from __future__ import annotations

import ast
import importlib
import operator
import re
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable
from importlib.metadata import metadata
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.version import Version
from places import REPOSITORY

from lab3_usd.check.registry import all_rules
from lab3_usd.features.collect.script import collect_script
from lab3_usd.spec.load.loader import load_lab

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = REPOSITORY
SOURCES = sorted((ROOT / "src").rglob("*.py"))
# Words that were given up, with those of docs/glossary.md and of ROS that say it.
GIVEN_UP = {
    r"\b(left|leaves it) open\b": "not judged, unknown",
    r"\bbut for\b": "except for",
    r"\brings? of (wires|frames)": "cycle of",
    r"\btrees apart\b": "disconnected trees",
    r"\bnothing is wired\b": "not connected",
    r"\bworks on zeros\b": "is not set",
    r"\bExit status:": "Exit code:",
    r"(?<!there) is no (rigid body|prim|node)\b": "is not a",
    r"\bin vain\b": "never",
}
# The brackets keep this file from naming what it looks for.
REGISTRY = [
    name.replace("[", "").replace("]", "").encode()
    for name in ("py[p]i.", "python[h]osted", "index-[u]rl", "find-[l]inks")
]
NODE_TYPE = re.compile(r"isaac[s]im\.|omni\.[g]raph")
MODULE_LINES = 500


def module_id(path: Path) -> str:
    return path.relative_to(ROOT / "src").as_posix()


def makefile_variable(name: str) -> list[str]:
    found = re.search(rf"^{name} := (.*)$", (ROOT / "Makefile").read_text(), flags=re.MULTILINE)
    assert found
    return found[1].split()


def our_dependencies() -> dict[str, Requirement]:
    """Return what the package asks for at run time, extras left out."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    parsed = [Requirement(line) for line in project["dependencies"]]
    return {each.name.lower(): each for each in parsed if each.marker is None}


def pins(name: str) -> dict[str, set[Version]]:
    """Return the versions that a file in `requirements/` pins for each package."""
    versions: dict[str, set[Version]] = {}
    for line in (ROOT / "requirements" / name).read_text().splitlines():
        if line and not line.startswith("#"):
            package, version = line.partition(";")[0].split("==")
            versions.setdefault(package.lower(), set()).add(Version(version.strip()))
    return versions


@pytest.fixture(scope="module")
def tracked() -> list[Path]:
    if not (ROOT / ".git").exists():
        pytest.skip("not a git checkout: which files belong to it is not known")
    listing = subprocess.run(
        ["git", "ls-files", "-z"],  # noqa: S607 - git is where the user has it
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    paths = [ROOT / name for name in listing.stdout.split("\0") if name]
    return [path for path in paths if path.is_file()]


def test_no_file_names_a_package_registry(tracked: list[Path]) -> None:
    def names_one(path: Path) -> bool:
        content = path.read_bytes().lower()
        return any(name in content for name in REGISTRY)

    assert [str(path.relative_to(ROOT)) for path in tracked if names_one(path)] == []


def test_python_names_no_node_type() -> None:
    naming = [module_id(path) for path in SOURCES if NODE_TYPE.search(path.read_text())]
    assert naming == []


# Before a set whose elements are taken stands one of these; of a dictionary, its first key tells.
MAY_BE_TAKEN = re.compile(
    r"(?:\bfor\s[^\n]*\bin\s|^\s*\)?\s*in\s|\b(?:tuple|list|join|iter|next)\(|[*,]|[-|&^]\s)"
    r"[\s(]*\{(?!\}|\*\*|\s*[\w.\"']+\s*:(?!=))",
    re.MULTILINE,
)
TEXT = re.compile(r'\bf"[^"\n]*"')  # with braces that are no sets


def is_set(node: ast.expr) -> bool:
    """Whether an expression is written as a set, or as what operators make of one."""
    if isinstance(node, ast.BinOp):
        return is_set(node.left) or is_set(node.right)
    return isinstance(node, ast.Set | ast.SetComp)


def ordered_sets(code: str) -> list[int]:
    """Return the lines that take the elements of a set in the order in which they come."""
    lines: list[int] = []
    if not MAY_BE_TAKEN.search(TEXT.sub('""', code)):
        return lines
    for node in ast.walk(ast.parse(code)):
        taken: list[ast.expr] = []
        if isinstance(node, ast.For):
            taken = [node.iter]
        elif isinstance(node, ast.Call):
            name = getattr(node.func, "id", getattr(node.func, "attr", ""))
            taken = node.args if name in {"tuple", "list", "join", "iter", "next"} else []
        elif isinstance(node, ast.List | ast.Tuple):
            taken = [elt.value for elt in node.elts if isinstance(elt, ast.Starred)]
        lines += [each.lineno for each in taken if is_set(each)]
    return lines


@pytest.mark.parametrize(
    "code",
    [
        "tuple({a, b} - {c})",
        "for each in {*a}: pass",
        "', '.join({a for a in b})",
        "[*{a}]",
        "for each in a - {b}: pass",
        "next(iter({a}), None)",
        "for (\n    a\n) in (\n    {b}\n): pass",
        "tuple(\n    ({a} | b)\n)",
    ],
)
def test_the_order_of_a_set_is_noticed(code: str) -> None:
    assert len(ordered_sets(code)) == 1


def test_nothing_depends_on_the_order_of_a_set() -> None:
    found = {module_id(path): ordered_sets(path.read_text()) for path in SOURCES}
    assert {module: lines for module, lines in found.items() if lines} == {}


def test_the_function_of_a_rule_is_named_as_the_rule_or_as_that_of_lint() -> None:
    names: dict[str, set[str]] = {}
    for rule in all_rules().values():
        names.setdefault(rule.check.__name__.replace("_", "-"), set()).add(rule.name)
    assert {name: rules for name, rules in names.items() if name not in rules} == {}


def test_a_module_is_one_idea() -> None:
    lines = {module_id(path): len(path.read_text().splitlines()) for path in SOURCES}
    assert {name: count for name, count in lines.items() if count > MODULE_LINES} == {}


# Every command and every format has a function of this name; a feature answers by the name of the
# question in `hooks`.
OF_EACH = {"command", "render"}
MOST_SHARED_FUNCTIONS, MOST_SHARED_MODULES = 25, 12


def public_functions(code: str) -> set[str]:
    functions = (node for node in ast.parse(code).body if isinstance(node, ast.FunctionDef))
    return {node.name for node in functions if not node.name.startswith("_")}


def shared(names: Iterable[str], least: int) -> list[str]:
    """Return the names that stand so many times."""
    return sorted(name for name, count in Counter(names).items() if count >= least)


def test_a_name_that_stands_twice_is_counted() -> None:
    code = "def a(): ...\ndef _b(): ...\nclass C:\n    def d(self): ..."
    assert public_functions(code) == {"a"}
    assert shared(["a", "b", "a"], 2) == ["a"]


def test_one_name_is_one_concept() -> None:
    functions = {path: public_functions(path.read_text()) for path in SOURCES}
    asked = next(names for path, names in functions.items() if path.name == "hooks.py")
    names = (name for names in functions.values() for name in names - asked - OF_EACH)
    modules = (path.stem for path in SOURCES if path.name != "__init__.py")
    assert len(shared(names, 2)) <= MOST_SHARED_FUNCTIONS
    assert len(shared(modules, 3)) <= MOST_SHARED_MODULES


# Outside of the rules and of the table that says which rule explains what a dry run shows.
OWN_IDS = ("lab3_usd/check/rules/", "lab3_usd/check/explanations.py")
MOST_RULE_IDS, MOST_PORTS = 18, 21
PORT = r"(?:in|out)puts:\w+"


def quoted(pattern: str, code: str) -> list[str]:
    return re.findall(rf'"({pattern})"', code)


def test_what_is_written_between_quotes_is_counted() -> None:
    assert quoted(r"[A-Z]\d\d", 'rule = "K22"  # not K23, and no "K225"') == ["K22"]


def test_ids_of_rules_and_ports_of_nodes_stand_in_one_place() -> None:
    texts = {module_id(path): path.read_text() for path in SOURCES}
    apart = "".join(text for name, text in texts.items() if not name.startswith(OWN_IDS))
    assert len([each for each in quoted(r"[A-Z]\d{2,3}", apart) if each in all_rules()]) <= (
        MOST_RULE_IDS
    )
    ports = quoted(PORT, "".join(texts.values()))
    assert len(ports) <= MOST_PORTS, "import the constant of a port from `facts`, or add one there"


def test_the_example_of_a_rule_keeps_to_the_constants_of_ports() -> None:
    example = (ROOT / "CONTRIBUTING.md").read_text().partition("```py +src")[2].partition("```")[0]
    assert "QUEUE" in example
    assert quoted(PORT, example) == []


# A private function of so few lines with one caller is to have a name that says what they do not.
FEW_LINES, MOST_SHORT_FUNCTIONS = 3, 63


def short_functions(code: str) -> list[str]:
    """Return the private functions of few lines that stand at one place beside their definition."""
    nodes = list(ast.walk(ast.parse(code)))
    uses = Counter(getattr(node, "id", getattr(node, "attr", "")) for node in nodes)
    return [
        node.name
        for node in nodes
        if isinstance(node, ast.FunctionDef) and not node.decorator_list and uses[node.name] == 1
        if re.match("_[a-z]", node.name) and lines_of_body(node) <= FEW_LINES
    ]


def lines_of_body(function: ast.FunctionDef) -> int:
    """Return how many lines a function has below its docstring."""
    first = function.body[ast.get_docstring(function) is not None]
    return (function.end_lineno or 0) - first.lineno + 1


def test_a_short_function_with_one_caller_is_noticed() -> None:
    body = '"""Say."""\n' + "".join(f"    {name} = 1\n" for name in "bcd")
    assert short_functions(f"def _a():\n    {body}_a()") == ["_a"]
    assert short_functions(f"def _a():\n    {body}    e = 1\n_a()") == []
    assert short_functions(f"def _a():\n    {body}_a(), _a()") == []


def test_a_short_function_has_several_callers_or_a_good_name() -> None:
    functions = [name for path in SOURCES for name in short_functions(path.read_text())]
    assert len(functions) <= MOST_SHORT_FUNCTIONS


def given_up(text: str) -> list[str]:
    """Return the words to write instead of those that were given up."""
    patterns = {words.replace(" ", r"\s+"): instead for words, instead in GIVEN_UP.items()}
    if not re.search("|".join(patterns), text):
        return []
    return [instead for words, instead in patterns.items() if re.search(words, text)]


def test_words_that_were_given_up_are_noticed() -> None:
    assert given_up("all but\n    for one ring of wires") == ["except for", "cycle of"]
    assert given_up("a string of frames, left open_file, button for") == []


def test_one_concept_has_one_word() -> None:
    paths = [*SOURCES, *(ROOT / "docs").glob("*.md"), ROOT / "README.md"]
    found = {path: given_up(path.read_text(encoding="utf-8")) for path in paths}
    assert {str(path): words for path, words in found.items() if words} == {}


def untyped_options(code: str) -> list[str]:
    """Return what takes the options of a command by names that nothing checks."""
    takers = [
        node.name
        for node in ast.walk(ast.parse(code))
        if isinstance(node, ast.FunctionDef) and node.name == "command" and node.args.kwarg
    ]
    return [*takers, *re.findall(r"Mapping\[str, Any\]", code)]


def test_options_by_name_alone_are_noticed() -> None:
    assert untyped_options("def command(path: str, **options: Any) -> None: ...") == ["command"]
    assert untyped_options("def run(options: Mapping[str, Any]) -> int: ...")
    assert untyped_options("def command(path: str, view: ViewOptions) -> None: ...") == []


def test_options_of_commands_are_records() -> None:
    commands = [path for path in SOURCES if {"commands", "features"} & {*path.parts}]
    found = {module_id(path): untyped_options(path.read_text()) for path in commands}
    assert {module: names for module, names in found.items() if names} == {}


def yaml_calls(tree: ast.AST) -> list[ast.Call]:
    return [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Attribute)
        and isinstance(node.func.value, ast.Name)
        and node.func.value.id == "yaml"
        and "load" in node.func.attr
    ]


def is_safe(call: ast.Call, module: object) -> bool:
    """Say whether a call of `yaml.load` and the like can make nothing but plain data."""
    assert isinstance(call.func, ast.Attribute)
    if call.func.attr in {"safe_load", "safe_load_all"}:
        return True
    loaders = [keyword.value for keyword in call.keywords if keyword.arg == "Loader"]
    if call.func.attr not in {"load", "load_all"} or not loaders:
        return False
    loader = operator.attrgetter(ast.unparse(loaders[0]))(module)
    names = ("SafeLoader", "CSafeLoader", "BaseLoader", "CBaseLoader")
    return issubclass(loader, tuple(filter(None, (getattr(yaml, name, None) for name in names))))


def test_yaml_is_loaded_safely_everywhere() -> None:
    naming = [path for path in SOURCES if "yaml" in path.read_text()]
    calls = [(path, call) for path in naming for call in yaml_calls(ast.parse(path.read_text()))]
    unsafe = []
    for path, call in calls:
        name = ".".join(path.relative_to(ROOT / "src").with_suffix("").parts)
        if not is_safe(call, importlib.import_module(name)):
            unsafe.append(f"{module_id(path)}:{call.lineno}")
    assert calls
    assert unsafe == []


def test_readme_sets_up_with_two_commands() -> None:
    named = re.findall(r"\bmake ([a-z][a-z-]*)", (ROOT / "README.md").read_text())
    assert make_targets() & set(named) == {"demo", "test"}


def make_targets() -> set[str]:
    declared = re.search(r"^\.PHONY: (.*)$", (ROOT / "Makefile").read_text(), flags=re.MULTILINE)
    assert declared
    return set(declared[1].split())


def test_every_make_command_of_the_contributors_guide_exists() -> None:
    guide = (ROOT / "CONTRIBUTING.md").read_text()
    named = set(re.findall(r"^make ([a-z-]+)|`make ([a-z-]+)`", guide, flags=re.MULTILINE))
    assert {first or second for first, second in named} <= make_targets()


def test_the_makefile_tests_the_pythons_that_the_package_declares() -> None:
    prefix = "Programming Language :: Python :: "
    classifiers = metadata("lab3-usd").get_all("Classifier") or []
    declared = [line.removeprefix(prefix) for line in classifiers if line.startswith(prefix)]
    assert makefile_variable("SUPPORTED") == declared


def test_lowest_pins_are_the_lower_bounds() -> None:
    lowest = pins("lowest.txt")
    for name, requirement in our_dependencies().items():
        bounds = {each.version for each in requirement.specifier if each.operator == ">="}
        assert {Version(bound) for bound in bounds} == lowest[name], name


def test_pins_lie_within_the_bounds() -> None:
    pinned = pins("run.txt")
    for name, requirement in our_dependencies().items():
        outside = [each for each in pinned[name] if each not in requirement.specifier]
        assert outside == [], name


def test_every_dependency_has_an_upper_bound() -> None:
    for name, requirement in our_dependencies().items():
        assert "<" in {each.operator for each in requirement.specifier}, name


def test_hooks_before_a_commit_fetch_nothing() -> None:
    config = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text())
    hooks = [hook for repo in config["repos"] for hook in repo["hooks"]]
    assert [repo["repo"] for repo in config["repos"]] == ["local"]
    assert {hook["language"] for hook in hooks} == {"system"}


def find_python(folder: Path, *versions: str) -> subprocess.CompletedProcess[str]:
    """Run `.ci/find-python` where `folder` is all there is on the PATH."""
    return subprocess.run(
        ["/bin/sh", str(ROOT / ".ci" / "find-python"), *versions],
        env={"PATH": str(folder), "HOME": str(folder)},
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )


def put_program(path: Path, script: str) -> None:
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)


def test_a_python_behind_a_broken_shim_is_not_found(tmp_path: Path) -> None:
    put_program(tmp_path / "python3.12", "exit 127")
    found = find_python(tmp_path)
    assert (found.returncode, found.stdout) == (1, "")


def test_a_python_without_a_version_in_its_name_is_found(tmp_path: Path) -> None:
    put_program(tmp_path / "python3.13", "exit 127")
    put_program(tmp_path / "python3", f'exec "{sys.executable}" "$@"')
    assert Path(find_python(tmp_path).stdout.strip()).samefile(sys.executable)


def test_a_python_of_another_version_than_asked_for_is_not_taken(tmp_path: Path) -> None:
    put_program(tmp_path / "python3.9", f'exec "{sys.executable}" "$@"')
    assert find_python(tmp_path, "3.9").returncode == 1


def shell_scripts() -> dict[str, str]:
    """Return our scripts, the one that collects evidence, and the steps of the action."""
    ours = {
        name: (ROOT / ".ci" / name).read_text() for name in ("run", "find-python", "suite", "test")
    }
    action = yaml.safe_load((ROOT / "action.yml").read_text())
    steps = {step["name"]: f"#!/bin/bash\n{step['run']}" for step in action["runs"]["steps"]}
    return ours | steps | {"collect": collect_script(load_lab())}


@pytest.mark.parametrize("name", shell_scripts())
def test_a_shell_script_is_clean(name: str) -> None:
    shellcheck = shutil.which("shellcheck")
    if not shellcheck:
        pytest.skip("ShellCheck is not installed")
    done = subprocess.run(
        [shellcheck, "-"], input=shell_scripts()[name], capture_output=True, text=True, check=False
    )
    assert done.stdout == ""
