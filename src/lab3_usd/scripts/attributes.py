"""What the attributes of values are: of objects and classes of the script, modules, handles."""

from __future__ import annotations

import ast
import math

from lab3_usd.model.stage import Unknown
from lab3_usd.scripts.run import Arguments, Run
from lab3_usd.scripts.values import (
    Class,
    Controller,
    External,
    Function,
    Handles,
    Instance,
    Items,
    Method,
    Scope,
    Super,
    Table,
    Text,
    Value,
    lifted,
    place,
    unknown,
)

KEYS = ("Keys", "GraphSetupKeys")
_NUMBERS = {"pi": math.pi, "inf": math.inf, "e": math.e, "tau": math.tau}
_NUMERIC = ("math", "numpy", "np", "torch")
_PROPERTY = ("property", "cached_property", "functools.cached_property")


def attribute_of(value: Value, node: ast.Attribute, run: Run) -> Value:
    """Return an attribute of a value."""
    name = node.attr
    if isinstance(value, Instance):
        return _of_instance(value, node, run)
    if isinstance(value, Class):
        member = value.find(name)
        return unknown(node) if member is None else _bound(member[0], value, member[1], node, run)
    if isinstance(value, Super):
        bases = [base for base in value.owner.bases if isinstance(base, Class)]
        member = next(filter(None, (base.find(name) for base in bases)), None)
        return (
            unknown(node) if member is None else _bound(member[0], value.own, member[1], node, run)
        )
    if isinstance(value, External):
        return _of_module(value, node)
    if isinstance(value, Controller) and name in KEYS:
        return External(name)
    if isinstance(value, Text):
        return _of_text(value, node)
    if name == "value" and isinstance(value, (int, float, bool, Items)):
        return value  # of an enumeration
    if isinstance(value, (Controller, Items, Table, Handles)):
        return Method(value, name)
    if isinstance(value, Unknown):
        return Unknown(f"{value.why}.{name}"[:60], node.lineno)
    return unknown(node)


def _of_text(value: Text, node: ast.Attribute) -> Value:
    if node.attr in ("pathString", "value"):
        return value
    if node.attr == "name" and value.is_path and value.unknown is None:
        return lifted(value.text.rpartition("/")[2], place(node))
    return Method(value, node.attr)


def _of_module(value: External, node: ast.Attribute) -> Value:
    if value.last in KEYS:
        return Text(node.attr.lower(), place(node))
    if node.attr in _NUMBERS and value.name in _NUMERIC:
        return _NUMBERS[node.attr]
    return External(f"{value.name}.{node.attr}")


def _of_instance(value: Instance, node: ast.Attribute, run: Run) -> Value:
    if node.attr in value.attributes:
        return value.attributes[node.attr]
    member = value.type.find(node.attr)
    if member is not None:
        return _bound(member[0], value, member[1], node, run)
    return run.set_elsewhere(value, node, run)


def _decorators(function: Function) -> list[str]:
    if isinstance(function.node, ast.Lambda):
        return []
    return [
        ast.unparse(each)
        for each in function.node.decorator_list
        if isinstance(each, (ast.Name, ast.Attribute))
    ]


def _bound(value: Value, own: Value, owner: Class, node: ast.Attribute, run: Run) -> Value:
    """Return a function of a class as a method of an object or class; other values as they are."""
    if not isinstance(value, Function):
        return value
    decorators = _decorators(value)
    if "staticmethod" in decorators:
        return value
    if "classmethod" in decorators:
        return value.of(own.type if isinstance(own, Instance) else own, owner)
    if isinstance(own, Class):
        return value
    method = value.of(own, owner)
    if any(each in _PROPERTY for each in decorators):
        return run.call_value(method, Arguments(), node, Scope("function"), run)
    return method


def assign_attribute(value: Value, name: str, new: Value) -> None:
    """Give an attribute of an object or a class a value."""
    if isinstance(value, Instance):
        value.attributes[name] = new
    elif isinstance(value, Class):
        value.scope.names[name] = new
