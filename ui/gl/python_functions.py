"""Python files as text: their functions as syntax trees and their constants as numbers, without importing them.

The exception are modules of this project that define constants (`engine.material.kinds`), which are plain numbers.
"""

from __future__ import annotations

import ast
import importlib
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from app.system.lazy_import import qualified

Number = float | int | bool


@dataclass
class PythonSource:
    """The functions and constants of one file. Constants are found when a function first uses them."""

    path: Path
    functions: dict[str, ast.FunctionDef] = field(default_factory=dict)
    _assigned: dict[str, ast.expr] = field(default_factory=dict)
    _modules: dict[str, str] = field(default_factory=dict)

    @classmethod
    def read(cls, path: Path) -> PythonSource:
        """Read a file; its classes' methods are functions named "Class.method"."""
        source = cls(path)
        for node in ast.parse(path.read_text(encoding="utf-8"), str(path)).body:
            source._take(node)
        return source

    def _take(self, node: ast.stmt) -> None:
        match node:
            case ast.FunctionDef():
                self.functions[node.name] = node
            case ast.ClassDef():
                methods = [each for each in node.body if isinstance(each, ast.FunctionDef)]
                self.functions |= {f"{node.name}.{each.name}": each for each in methods}
            case ast.Assign(targets=[ast.Name(id=name)]):
                self._assigned[name] = node.value
            case ast.Assign(targets=[ast.Tuple(elts=names)], value=ast.Tuple(elts=values)):
                pairs = zip(names, values, strict=True)
                self._assigned |= {name.id: value for name, value in pairs if isinstance(name, ast.Name)}
            case ast.ImportFrom(module=str(module)):
                self._modules |= {each.asname or each.name: f"{module}.{each.name}" for each in node.names}

    def constant(self, name: str) -> Number | None:
        """The number that a name of the file stands for; None for anything else."""
        if name in self._assigned:
            return self.number(self._assigned[name])
        if name in self._modules:
            module, _, attribute = self._modules[name].rpartition(".")
            return _plain_number(getattr(_imported(module), attribute, None))
        return None

    def number(self, node: ast.expr) -> Number | None:
        """The value of an expression of constants."""
        match node:
            case ast.Constant(value=value):
                return _plain_number(value)
            case ast.Name(id=name):
                return self.constant(name)
            case ast.Attribute(value=ast.Name(id="math"), attr=name):
                return _plain_number(getattr(math, name, None))
            case ast.Attribute(value=ast.Name(id=module), attr=name) if module in self._modules:
                return _plain_number(getattr(_imported(self._modules[module]), name, None))
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                found = self.number(operand)
                return None if found is None else -found
            case ast.BinOp(left=left, op=op, right=right):
                return _computed(op, self.number(left), self.number(right))
        return None


def _imported(module: str) -> Any:
    """A module of plain numbers, or nothing where there is none of that name."""
    try:
        return importlib.import_module(module) if module.startswith(qualified("engine.")) else None
    except ImportError:
        return None


def _plain_number(value: object) -> Number | None:
    return value if isinstance(value, (int, float)) else None


def _computed(op: ast.operator, left: Number | None, right: Number | None) -> Number | None:
    if left is None or right is None:
        return None
    match op:
        case ast.Add():
            return left + right
        case ast.Sub():
            return left - right
        case ast.Mult():
            return left * right
        case ast.Div():
            return left / right
        case ast.Pow():
            return float(left**right)
    return None
