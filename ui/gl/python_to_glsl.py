"""Translates quotients and angles of models, plain Python functions of floats, to GLSL 4.10.

A model is one file: its quotient is defined there (or in `engine.material._kernels`) once, for the worker's compiler
and for shaders. The functions are read as text and never imported, so that the window needs no compiler:

    source ─ast─► assignments, if, return, arithmetic, math.* ─► GLSL functions, those they call before them

Known arguments (the kind of an angle, the number of a model) are substituted, and branches that they decide are left
out: a shader contains only what its layers need. Constants below single precision become its least number. Rejected:
models with a GLSL text of their own, which is the same formula in two places; tracing of Python values, which cannot
see branches.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping
from dataclasses import dataclass

from engine.core.errors import InsituError
from ui.gl.python_functions import Number, PythonSource

LEAST, LARGEST = 1.1754944e-38, 3.4028235e38
# The exact forms for single precision are in shaders/brdf/arithmetic.glsl.
MATH = {
    "sqrt": "sqrt", "exp": "exponential", "log": "logarithm", "log1p": "logarithm_of_1_and", "fabs": "abs",
    "expm1": "exponential_less_1", "atan2": "arc_tangent", "atan": "arc_tangent_of", "acos": "arc_cosine",
    "asin": "arc_sine", "sin": "sin", "cos": "cos", "tan": "tan", "pow": "power", "hypot": "hypotenuse",
    "floor": "floor", "ceil": "ceil",
}  # fmt: skip
BUILTINS = {"min", "max", "abs"}
OPERATORS: dict[type[ast.operator], str] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
COMPARISONS: dict[type[ast.cmpop], str] = {
    ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!=",
}  # fmt: skip


class Untranslatable(InsituError):
    """A function uses something that has no counterpart in GLSL; the message names file, line and construct."""


def literal(value: float) -> str:
    """A float of single precision; a value that would become 0 is the least one above."""
    if not abs(value) <= LARGEST:
        raise Untranslatable(f"the constant {value!r} is beyond single precision")
    if value != 0.0 and abs(value) < LEAST:
        value = math.copysign(LEAST, value)
    return repr(float(value)) if value >= 0.0 else f"({float(value)!r})"


@dataclass(frozen=True)
class ForeignFunction:
    """The file where a called function is defined; `skipped` of its first arguments are for the caller alone."""

    source: PythonSource
    name: str
    skipped: int = 0


class Translation:
    """A growing GLSL text: functions in a valid order, each once for each set of known arguments."""

    def __init__(self) -> None:
        self._names: dict[tuple[object, ...], str] = {}
        self._texts: list[str] = []

    @property
    def text(self) -> str:
        """All functions so far."""
        return "\n".join(self._texts)

    def function(
        self, source: PythonSource, name: str, known: Mapping[str, Number], foreign: Mapping[str, ForeignFunction]
    ) -> str:
        """The GLSL name of a function with some known arguments, translated where it has not been yet.

        Known arguments are not passed. `foreign` tells which called functions are in other files. Raises
        Untranslatable.
        """
        elsewhere = tuple((called, other.source.path, other.name) for called, other in foreign.items())
        key = (source.path, name, tuple(sorted(known.items())), elsewhere)
        if key not in self._names:
            node = source.functions.get(name)
            if node is None:
                raise Untranslatable(f"{source.path.name}: there is no function {name}")
            said = name.rpartition(".")[2].strip("_").replace("__", "_")
            body = _Function(self, source, node, dict(known), foreign)
            head, lines = body.translated()  # adds what it calls first
            self._names[key] = f"f{len(self._names)}_{said}"
            self._texts.append("\n".join([f"float {self._names[key]}({head}) {{", *lines, "}", ""]))
        return self._names[key]


class _Function:
    """One function being translated. Variables are declared at its head, because Python's outlive the branch they begin
    in."""

    def __init__(
        self,
        translation: Translation,
        source: PythonSource,
        node: ast.FunctionDef,
        known: dict[str, Number],
        foreign: Mapping[str, ForeignFunction],
    ) -> None:
        self._translation, self._source, self._node = translation, source, node
        self._known, self._foreign = known, foreign
        self._arguments = {argument.arg for argument in node.args.args}
        names = [each for each in ast.walk(node) if isinstance(each, ast.Name)]
        self._hidden = self._arguments | {each.id for each in names if isinstance(each.ctx, ast.Store)}
        self._arrays: set[str] = set()
        self._variables: dict[str, str] = {}
        self._n_temporaries = 0

    def translated(self) -> tuple[str, list[str]]:
        """The parameters, and the lines between the braces."""
        parameters = [self._parameter(each) for each in self._node.args.args if each.arg not in self._known]
        lines = self._block(self._node.body, 1)
        declared = [f"    {kind} {variable};" for variable, kind in self._variables.items()]
        return ", ".join(parameters), [*declared, *lines]

    def _parameter(self, argument: ast.arg) -> str:
        kind = argument.annotation.id if isinstance(argument.annotation, ast.Name) else None
        if kind == "Float64Array":
            self._arrays.add(argument.arg)
            return f"mat2x4 v_{argument.arg}"
        if kind != "float":
            expected = "a float or the parameters (Float64Array)"
            raise self._refused(argument, f"the argument {argument.arg}, expected {expected}")
        return f"float v_{argument.arg}"

    # ------------------------------------------------------------------------------------------------------- statements

    def _block(self, body: list[ast.stmt], depth: int) -> list[str]:
        """Lines of statements, up to the first that always returns."""
        lines: list[str] = []
        for statement in body:
            lines += self._statement(statement, depth)
            if _returns(lines, depth):
                break
        return lines

    def _statement(self, node: ast.stmt, depth: int) -> list[str]:
        tab = "    " * depth
        match node:
            case ast.Expr(value=ast.Constant(value=str())) | ast.Pass():
                return []
            case ast.Return(value=ast.expr() as value):
                return [f"{tab}return {self._value(value)};"]
            case ast.Assign(targets=[ast.Name(id=name)], value=value):
                return [f"{tab}{self._assigned(name, value)} = {self._value(value)};"]
            case ast.Assign(targets=[ast.Tuple(elts=names)], value=ast.Tuple(elts=values)) if len(names) == len(values):
                return self._several(names, values, tab)
            case ast.AnnAssign(target=ast.Name(id=name), value=ast.expr() as value):
                return [f"{tab}{self._assigned(name, value)} = {self._value(value)};"]
            case ast.AugAssign(target=ast.Name(id=name), op=op, value=value):
                whole = ast.copy_location(ast.BinOp(ast.Name(name, ast.Load()), op, value), node)
                return [f"{tab}{self._assigned(name, value)} = {self._value(whole)};"]
            case ast.If():
                return self._if(node, depth)
        raise self._refused(node, type(node).__name__)

    def _several(self, names: list[ast.expr], values: list[ast.expr], tab: str) -> list[str]:
        """Evaluate all values before any assignment, as Python does, where one of the names is read."""
        targets = [each.id for each in names if isinstance(each, ast.Name)]
        if len(targets) < len(names):
            raise self._refused(names[0], "an assignment to something without a name")
        said = [self._value(value) for value in values]
        read = {each.id for value in values for each in ast.walk(value) if isinstance(each, ast.Name)}
        lines = []
        if read.intersection(targets):
            self._n_temporaries += 1
            kept = [f"t{self._n_temporaries}_{place}" for place in range(len(said))]
            lines = [f"{tab}float {name} = {value};" for name, value in zip(kept, said, strict=True)]
            said = kept
        return lines + [f"{tab}{self._assigned(name, value)} = {text};"
                        for name, value, text in zip(targets, values, said, strict=True)]  # fmt: skip

    def _assigned(self, name: str, value: ast.expr) -> str:
        if name in self._known or name in self._arrays:
            raise self._refused(value, f"an assignment to the argument {name}")
        variable = f"v_{name}".replace("__", "_0")
        if name not in self._arguments:
            kind = "bool" if isinstance(value, (ast.Compare, ast.BoolOp)) or _is_not(value) else "float"
            if self._variables.setdefault(variable, kind) != kind:
                raise self._refused(value, f"{name}, a condition here and a number elsewhere")
        return variable

    def _if(self, node: ast.If, depth: int) -> list[str]:
        tab = "    " * depth
        decided = self._known_outcome(node.test)
        if decided is not None:
            return self._block(node.body if decided else node.orelse, depth)
        lines = [f"{tab}if ({self._value(node.test)}) {{", *self._block(node.body, depth + 1)]
        if node.orelse:
            lines += [f"{tab}}} else {{", *self._block(node.orelse, depth + 1)]
        return [*lines, f"{tab}}}"]

    # ------------------------------------------------------------------------------------------------------ expressions

    def _value(self, node: ast.expr) -> str:
        number = self._number(node)
        if number is not None:
            return ("true" if number else "false") if isinstance(number, bool) else literal(number)
        match node:
            case ast.Name(id=name):
                return self._name(node, name)
            case ast.Subscript(value=ast.Name(id=name), slice=place) if name in self._arrays:
                column, row = divmod(self._place(place), 4)
                return f"v_{name}[{column}][{row}]"
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return f"(-{self._value(operand)})"
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return f"(!{self._value(operand)})"
            case ast.BinOp(left=left, op=ast.Pow(), right=right):
                return f"power({self._value(left)}, {self._value(right)})"
            case ast.BinOp(left=left, op=op, right=right) if type(op) in OPERATORS:
                return f"({self._value(left)} {OPERATORS[type(op)]} {self._value(right)})"
            case ast.Compare():
                return self._comparison(node)
            case ast.BoolOp(op=op, values=values):
                joint = " && " if isinstance(op, ast.And) else " || "
                return f"({joint.join(map(self._value, values))})"
            case ast.IfExp(test=test, body=body, orelse=orelse):
                decided = self._known_outcome(test)
                if decided is not None:
                    return self._value(body if decided else orelse)
                return f"({self._value(test)} ? {self._value(body)} : {self._value(orelse)})"
            case ast.Call():
                return self._call(node)
        raise self._refused(node, ast.unparse(node))

    def _number(self, node: ast.expr) -> Number | None:
        """The value of an expression that does not depend on directions; variables hide constants of the same name."""
        match node:
            case ast.Name(id=name):
                return self._known.get(name) if name in self._hidden else self._source.constant(name)
            case ast.Constant() | ast.Attribute():
                return self._source.number(node)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                found = self._number(operand)
                return None if found is None else -found
        return None

    def _name(self, node: ast.expr, name: str) -> str:
        variable = f"v_{name}".replace("__", "_0")
        if variable not in self._variables and name not in self._arguments:
            raise self._refused(node, f"{name}, which is neither a variable nor a number")
        return variable

    def _place(self, node: ast.expr) -> int:
        place = self._number(node)
        if not isinstance(place, int) or not 0 <= place < 8:
            raise self._refused(node, "a place among the parameters that is not a number from 0 to 7")
        return place

    def _comparison(self, node: ast.Compare) -> str:
        sides = [self._value(each) for each in (node.left, *node.comparators)]
        signs = [COMPARISONS.get(type(op)) for op in node.ops]
        if None in signs:
            raise self._refused(node, ast.unparse(node))
        pairs = [f"({left} {sign} {right})" for left, sign, right in zip(sides, signs, sides[1:], strict=False)]
        return pairs[0] if len(pairs) == 1 else f"({' && '.join(pairs)})"

    def _known_outcome(self, test: ast.expr) -> bool | None:
        """The outcome of a condition on known values; None where it depends on directions."""
        match test:
            case ast.BoolOp(op=op, values=values):
                outcomes = [self._known_outcome(each) for each in values]
                settling = isinstance(op, ast.Or)
                if settling in outcomes:
                    return settling
                return None if None in outcomes else not settling
            case ast.Compare(left=left, ops=[op], comparators=[right]):
                one, two = self._number(left), self._number(right)
                if one is None or two is None:
                    return None
                return _compared(op, one, two)
        found = self._number(test)
        return None if found is None else bool(found)

    def _call(self, node: ast.Call) -> str:
        if node.keywords or any(isinstance(each, ast.Starred) for each in node.args):
            raise self._refused(node, "named or starred arguments")
        match node.func:
            case ast.Attribute(value=ast.Name(id="math"), attr=name) if name in MATH:
                return f"{MATH[name]}({', '.join(map(self._value, node.args))})"
            case ast.Name(id=name) if name in BUILTINS:
                return self._nested(name, [self._value(each) for each in node.args])
            case ast.Name(id=name) if name in self._foreign:
                other = self._foreign[name]
                return self._called(other.source, other.name, node.args[other.skipped :])
            case ast.Name(id=name) if name in self._source.functions:
                return self._called(self._source, name, node.args)
        raise self._refused(node, f"a call of {ast.unparse(node.func)}")

    def _nested(self, name: str, arguments: list[str]) -> str:
        """min and max of any number of values."""
        if name == "abs" or len(arguments) <= 2:
            return f"{name}({', '.join(arguments)})"
        return f"{name}({arguments[0]}, {self._nested(name, arguments[1:])})"

    def _called(self, source: PythonSource, name: str, arguments: list[ast.expr]) -> str:
        """A call; what is known here and is not a float in the callee is known there."""
        node = source.functions.get(name)
        if node is None or len(node.args.args) != len(arguments):
            raise self._refused(self._node, f"a call of {name} with {len(arguments)} arguments")
        known: dict[str, Number] = {}
        passed: list[str] = []
        for parameter, argument in zip(node.args.args, arguments, strict=True):
            value = self._number(argument)
            if value is not None and isinstance(parameter.annotation, ast.Name) and parameter.annotation.id == "int":
                known[parameter.arg] = value
            elif isinstance(argument, ast.Name) and argument.id in self._arrays:
                passed.append(f"v_{argument.id}")
            else:
                passed.append(self._value(argument))
        return f"{self._translation.function(source, name, known, self._foreign)}({', '.join(passed)})"

    def _refused(self, node: ast.AST, what: str) -> Untranslatable:
        line = getattr(node, "lineno", self._node.lineno)
        place = f"{self._source.path.name}:{line}: {self._node.name}"
        return Untranslatable(f"{place} has {what}, which has no counterpart in a shader")


def _is_not(node: ast.expr) -> bool:
    return isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not)


def _returns(lines: list[str], depth: int) -> bool:
    """Whether nothing after these lines of a block is reached."""
    return bool(lines) and lines[-1].startswith("    " * depth + "return ")


def _compared(op: ast.cmpop, one: Number, two: Number) -> bool | None:
    match op:
        case ast.Eq():
            return one == two
        case ast.NotEq():
            return one != two
        case ast.Lt():
            return one < two
        case ast.LtE():
            return one <= two
        case ast.Gt():
            return one > two
        case ast.GtE():
            return one >= two
    return None
