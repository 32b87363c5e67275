"""Mutants of a source file: small faults that its tests should find, one at a time."""

import ast
import random
from collections.abc import Iterator
from typing import NamedTuple

BINARY = {
    ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*", ast.FloorDiv: "*", ast.Mod: "*", ast.Pow: "*",
    ast.BitAnd: "|", ast.BitOr: "&", ast.BitXor: "&", ast.LShift: ">>", ast.RShift: "<<",
}  # fmt: skip
COMPARED = {
    ast.Lt: ("<=", ">="), ast.LtE: ("<", ">"), ast.Gt: (">=", "<="), ast.GtE: (">", "<"), ast.Eq: ("!=",),
    ast.NotEq: ("==",), ast.Is: ("is not",), ast.IsNot: ("is",), ast.In: ("not in",), ast.NotIn: ("in",),
}  # fmt: skip
"""The boundary moved, and the opposite."""
PAIRS = (
    ("min", "max"), ("minimum", "maximum"), ("fmin", "fmax"), ("argmin", "argmax"), ("any", "all"), ("sin", "cos"),
    ("floor", "ceil"), ("zeros", "ones"), ("zeros_like", "ones_like"), ("isfinite", "isnan"), ("sum", "max"),
)  # fmt: skip
FUNCTIONS = {a: b for pair in PAIRS for a, b in (pair, pair[::-1])} | {"abs": "", "sqrt": "", "max": "min"}
"""Functions that take each other's place; of one without another its argument remains."""
ATTRIBUTES = {
    "support": "valid", "valid": "support", "transfer": "support", "second_half": "support",
    "q": "dq", "dq": "q", "foot": "velocity", "velocity": "foot", "feedback": "feedforward", "error": "output",
}  # fmt: skip
"""Arrays of the same shape that take each other's place: phases of a cycle, states, torques."""
DECLARATIONS = {"number", "choice", "flag", "text", "Metric", "Shown", "Annotated", "TypeVar", "BadInput"}
"""Calls that declare fields, how values are shown, types and messages; only lambdas in them are mathematics."""


class Mutant(NamedTuple):
    """A fault: in ``path`` from the root of the project, ``start`` to ``end`` of the source becomes ``new``."""

    path: str
    line: int
    function: int
    """First line of the innermost function that runs it, decorators included; 0 outside of functions."""
    start: int
    end: int
    old: str
    new: str
    context: str
    """The line as it was."""

    def apply(self, source: bytes) -> bytes:
        """``source`` with the fault."""
        return source[: self.start] + self.new.encode() + source[self.end :]


def changes(node: ast.AST, text) -> Iterator[tuple[ast.AST, str]]:
    """Each node to replace and its new text; ``text`` gives the text of a node."""
    match node:
        case ast.BinOp(left, op, right) if type(op) in BINARY:
            yield node, f"(({text(left)}) {BINARY[type(op)]} ({text(right)}))"
        case ast.AugAssign(target, op, value) if type(op) in BINARY:
            yield node, f"{text(target)} {BINARY[type(op)]}= {text(value)}"
            yield node, "pass"
        case ast.Compare(left, [op], [right]):
            for new in COMPARED[type(op)]:
                yield node, f"(({text(left)}) {new} ({text(right)}))"
        case ast.BoolOp(op, values):
            new = " or " if isinstance(op, ast.And) else " and "
            yield node, "(" + new.join(f"({text(value)})" for value in values) + ")"
        case ast.UnaryOp(ast.USub() | ast.Not(), operand):
            yield node, f"({text(operand)})"
        case ast.Constant(bool(value)):
            yield node, str(not value)
        case ast.Constant(int(value)):
            yield node, str(value + 1)
            yield node, str(value - 1)
        case ast.Constant(float(value)):
            yield node, repr(2.0 * value or 1.0)
            yield node, repr(value + 1.0)
        case ast.Call(ast.Name(name) as called) if name in FUNCTIONS:
            yield called, FUNCTIONS[name]
        case ast.Call(ast.Attribute(owner, name) as called) if FUNCTIONS.get(name):
            yield called, f"({text(owner)}).{FUNCTIONS[name]}"
        case ast.Attribute(owner, name, ast.Load()) if name in ATTRIBUTES:
            yield node, f"({text(owner)}).{ATTRIBUTES[name]}"
        case ast.If(test) | ast.IfExp(test) | ast.While(test):
            yield test, f"(not ({text(test)}))"
        case ast.Assign([ast.Subscript()]) | ast.Expr(ast.Call()):
            yield node, "pass"
        case ast.Continue():
            yield node, "break"
        case ast.Break():
            yield node, "pass"


def parts(node: ast.AST) -> Iterator[ast.AST]:
    """Children of a node but annotations, decorators, messages, declarations and functions that give text."""
    match node:
        case ast.FunctionDef():
            gives_text = isinstance(node.returns, ast.Name) and node.returns.id == "str"
            yield from [] if gives_text else [*node.args.defaults, *node.args.kw_defaults, *node.body]
        case ast.AnnAssign():
            yield from [node.value] if node.value else []
        case ast.Call(ast.Name(name)) if name in DECLARATIONS:
            yield from (part for part in node.args if isinstance(part, ast.Lambda))
        case ast.Raise() | ast.JoinedStr() | ast.Assert():
            pass
        case _:
            yield from ast.iter_child_nodes(node)


def find_mutants(path: str, source: str) -> list[Mutant]:
    """All mutants of a file."""
    data = source.encode()
    lines = data.splitlines(keepends=True)
    starts = [0]
    for line in lines:
        starts.append(starts[-1] + len(line))

    def span(node) -> tuple[int, int]:
        return starts[node.lineno - 1] + node.col_offset, starts[node.end_lineno - 1] + node.end_col_offset

    def text(node) -> str:
        start, end = span(node)
        return data[start:end].decode()

    found = []

    def visit(node: ast.AST | None, function: int) -> None:
        if node is None:
            return
        for changed, new in changes(node, text):
            start, end = span(changed)
            line = lines[changed.lineno - 1].decode().strip()
            found.append(Mutant(path, changed.lineno, function, start, end, text(changed), new, line))
        inside, defaults = function, []
        if isinstance(node, ast.FunctionDef | ast.Lambda):
            decorators = getattr(node, "decorator_list", [])
            inside = min([node.lineno, *(decorator.lineno for decorator in decorators)])
            defaults = [*node.args.defaults, *node.args.kw_defaults]
        for part in parts(node):
            visit(part, function if part in defaults else inside)

    visit(ast.parse(source), 0)
    return list(dict.fromkeys(found))  # 1.0 + 1.0 is 2.0 * 1.0


def sample(mutants: dict[str, list[Mutant]], number: int, least: int, seed: int) -> list[Mutant]:
    """About ``number`` of all ``mutants``: of each file by its size, but at least ``least``, if it has so many.

    They come in a random order, so that the first of them are a sample too.
    """
    rng = random.Random(seed)
    total = sum(map(len, mutants.values()))
    chosen = []
    for path in sorted(mutants):
        own = mutants[path]
        chosen += rng.sample(own, min(len(own), max(least, round(number * len(own) / total))))
    rng.shuffle(chosen)
    return chosen
