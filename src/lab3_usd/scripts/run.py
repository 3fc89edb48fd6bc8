"""What one way through a script has done so far, and what it may still do."""

from __future__ import annotations

import ast
from collections.abc import Callable, Sequence

from msgspec import Struct

from lab3_usd.isaac.behaviour import Building
from lab3_usd.scripts.values import Function, Instance, Scope, Value
from lab3_usd.scripts.world import World

MOST_STEPS = 250_000
DEEPEST_CALL = 40
DEEPEST_PART = 900
MOST_ROUNDS = 2_000  # of one loop
FEW_ROUNDS = 3  # of one that builds nothing and changes no list


class StepLimitError(Exception):
    """The evaluation took as many steps as it may."""


class Arguments(Struct, eq=False):
    """What a call is given by place and by name; `is_open` where more of it is unknown."""

    given: list[Value] = []
    named: dict[str, Value] = {}
    is_open: bool = False

    @property
    def first(self) -> Value:
        """The first value, by place or else by name."""
        return next(iter((*self.given, *self.named.values())), None)

    def get(self, place: int, name: str, default: Value = None) -> Value:
        """Return the value at a place or of a name."""
        if place < len(self.given):
            return self.given[place]
        return self.named.get(name, default)

    def has(self, place: int, name: str) -> bool:
        """Whether there is a value at a place or of a name."""
        return place < len(self.given) or name in self.named


class Run(Struct, eq=False):
    """One way through the script: which branch it takes where that is unknown, what it builds.

    `decisions` are the branches to take, in the order in which they are met; the first branch is
    taken behind them. `taken` are those that were, by the words of their tests in `decided`;
    `entered` the functions that were called, and `inner` those that functions define. `builders`
    are the parts of the script that build graphs, and `looked_at` what is known of others, by
    their number. `call_value` is how anything is called, `assign` how a target gets a value, and
    `set_elsewhere` finds an attribute that another method sets: who evaluates does not know them.
    """

    decisions: Sequence[bool]
    builders: frozenset[int]
    building: Building
    looked_at: dict[int, bool]
    world: World
    call_value: Callable[[Value, Arguments, ast.AST, Scope, Run], Value]
    assign: Callable[[ast.expr, Value, Scope, Run], None]
    set_elsewhere: Callable[[Instance, ast.Attribute, Run], Value]
    taken: list[bool] = []
    decided: dict[str, bool] = {}
    entered: set[int] = set()
    inner: list[Function] = []
    instances: list[Instance] = []
    calls: list[int] = []
    steps: int = MOST_STEPS
    depth: int = 0
    line: int = 1

    def step(self, node: ast.AST) -> None:
        """Count a step.

        Raises:
            StepLimitError: it is one too many.
        """
        self.steps -= 1
        self.line = getattr(node, "lineno", self.line)
        if self.steps < 0:
            raise StepLimitError

    def decide(self, test: ast.AST) -> bool:
        """Return which way to go at a test whose outcome is unknown: the same at the same words."""
        turned = isinstance(test, ast.UnaryOp) and isinstance(test.op, ast.Not)
        inner = test.operand if isinstance(test, ast.UnaryOp) and turned else test
        key = ast.dump(inner)
        if key not in self.decided:
            number = len(self.taken)
            choice = self.decisions[number] if number < len(self.decisions) else True
            self.taken.append(choice)
            self.decided[key] = choice != turned
        return self.decided[key] != turned
