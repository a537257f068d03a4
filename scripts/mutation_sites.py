"""The mutants that `mutation_sample.py` draws from: one small change of the code each.

The changes are those of mutmut's mutators: another operator, comparison, number, string or keyword,
an argument that is None or left out, an assignment of None. mutmut itself applies them to functions
without decorators only; here they also go to properties, class methods, dataclass fields and
constants. Left out are changes that no test should notice:

- docstrings, type annotations and aliases, decorators, `__repr__`, `__all__`;
- the texts of errors, warnings and log lines;
- arguments that only assert: `strict` of `zip`, the type of `cast`, `encoding`.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Final

import libcst as cst
import libcst.matchers as m
from libcst.metadata import MetadataWrapper, PositionProvider
from mutmut.mutation.mutators import mutation_operators

_SKIPPED_FUNCTIONS: Final = {"__repr__", "__str__"}
# `len` and `isinstance` have no argument that can be left out; mutmut skips them too.
_SKIPPED_CALLS: Final = {"len", "isinstance", "cast", "warn", "debug", "info", "warning"}
_SKIPPED_KEYWORDS: Final = {"strict", "encoding"}
# The export list, loggers, type aliases and type variables.
_NO_VALUE: Final = re.compile(r"__all__|_log|_?[A-Z]\w*[a-z]\w*")
_NO_BODY: Final = m.IndentedBlock(  # of protocols and overloads
    [m.ZeroOrMore(m.SimpleStatementLine([m.Expr(m.SimpleString() | m.Ellipsis())]))]
)
_STATEMENTS: Final = (cst.BaseSmallStatement, cst.BaseCompoundStatement)


@dataclass(frozen=True)
class Mutant:
    """A changed file.

    Attributes
    ----------
    file : str
        Relative to the project.
    lines : range
        The changed statement; its head if it has a body.
    names : frozenset of str, optional
        What the statement defines, if it runs when the module is imported.
    old, new : str
        The lines that differ, without indentation.
    text : str
        The whole changed file.
    """

    file: str
    lines: range
    names: frozenset[str] | None
    old: str
    new: str
    text: str


def count_mutants(project: Path, file: str) -> int:
    """The number of changes that a file can have."""
    return len(_parsed(project / file)[1])


def mutant(project: Path, file: str, index: int) -> Mutant:
    """Apply one of the changes to the file's text."""
    module, sites = _parsed(project / file)
    site = sites[index]
    changed = module.deep_replace(site.node, site.replacement)
    assert isinstance(changed, cst.Module)
    text = changed.code
    return Mutant(file, site.lines, site.names, *_difference(module.code, text), text)


@cache
def _parsed(path: Path) -> tuple[cst.Module, list[_Site]]:
    wrapper = MetadataWrapper(cst.parse_module(path.read_text(encoding="utf-8")))
    visitor = _Visitor()
    wrapper.visit(visitor)
    return wrapper.module, visitor.sites


def _difference(old: str, new: str) -> tuple[str, str]:
    """The lines of two texts that differ, each as one line."""
    old_lines, new_lines = old.splitlines(), new.splitlines()
    start = _equal(old_lines, new_lines)
    end = _equal(old_lines[start:][::-1], new_lines[start:][::-1])
    parts = old_lines[start : len(old_lines) - end], new_lines[start : len(new_lines) - end]
    old_part, new_part = (" ".join(line.strip() for line in part) for part in parts)
    return old_part, new_part


def _equal(first: list[str], second: list[str]) -> int:
    """The number of equal lines at the beginning."""
    pairs = enumerate(zip(first, second, strict=False))
    return next((n for n, (one, other) in pairs if one != other), min(len(first), len(second)))


@dataclass(frozen=True)
class _Site:
    node: cst.CSTNode
    replacement: cst.CSTNode
    lines: range
    names: frozenset[str] | None


class _Visitor(cst.CSTVisitor):
    METADATA_DEPENDENCIES = (PositionProvider,)

    def __init__(self) -> None:
        super().__init__()
        self.sites: list[_Site] = []
        self._statements: list[cst.CSTNode] = []
        self._bodies: list[cst.CSTNode] = []  # of the functions around the node

    def on_visit(self, node: cst.CSTNode) -> bool:
        if _is_skipped(node):
            return False
        outer = self._statements[-1] if self._statements else None
        if isinstance(outer, cst.FunctionDef) and node is outer.body:
            self._bodies.append(node)
        if isinstance(node, _STATEMENTS):
            self._statements.append(node)
        for kind, mutator in mutation_operators:
            if isinstance(node, kind):
                for replacement in mutator(node):
                    if not _drops_an_assertion(node, replacement):
                        self._add(node, replacement)
        return True

    def on_leave(self, original_node: cst.CSTNode) -> None:
        if self._statements and original_node is self._statements[-1]:
            self._statements.pop()
        if self._bodies and original_node is self._bodies[-1]:
            self._bodies.pop()

    def _add(self, node: cst.CSTNode, replacement: cst.CSTNode) -> None:
        statement = self._statements[-1]
        span = self.get_metadata(PositionProvider, statement)
        last = span.end.line
        if isinstance(statement, cst.BaseCompoundStatement):
            inner = _parts(statement)[0]
            last = max(span.start.line, self.get_metadata(PositionProvider, inner).start.line - 1)
        names = None if self._bodies else _defined_names(statement)
        self.sites.append(_Site(node, replacement, range(span.start.line, last + 1), names))


def _parts(statement: cst.BaseCompoundStatement) -> Sequence[cst.CSTNode]:
    parts: Sequence[cst.CSTNode]
    parts = statement.cases if isinstance(statement, cst.Match) else statement.body.body
    return parts


def _is_skipped(node: cst.CSTNode) -> bool:
    """Whether no test should notice a change of the node."""
    if isinstance(node, cst.Annotation | cst.Decorator | cst.Raise | cst.Assert):
        return True
    if isinstance(node, cst.Expr):
        return isinstance(node.value, cst.BaseString | cst.Ellipsis)
    if isinstance(node, cst.FunctionDef):
        return node.name.value in _SKIPPED_FUNCTIONS or m.matches(node.body, _NO_BODY)
    if isinstance(node, cst.Call):
        name = _called_name(node)
        return name in _SKIPPED_CALLS or name.endswith(("Error", "Warning"))
    if isinstance(node, cst.Arg):
        return _only_asserts(node)
    if isinstance(node, cst.Assign | cst.AnnAssign):
        return any(_NO_VALUE.fullmatch(name) for name in _defined_names(node))
    return isinstance(node, cst.If) and m.matches(node.test, m.Name("TYPE_CHECKING"))


def _called_name(node: cst.Call) -> str:
    name = node.func.attr if isinstance(node.func, cst.Attribute) else node.func
    return str(name.value) if isinstance(name, cst.Name) else ""


def _only_asserts(node: cst.Arg) -> bool:
    return node.keyword is not None and node.keyword.value in _SKIPPED_KEYWORDS


def _drops_an_assertion(node: cst.CSTNode, replacement: cst.CSTNode) -> bool:
    if not (isinstance(node, cst.Call) and isinstance(replacement, cst.Call)):
        return False
    kept = {id(argument) for argument in replacement.args}
    return any(_only_asserts(argument) for argument in node.args if id(argument) not in kept)


def _defined_names(node: cst.CSTNode) -> frozenset[str]:
    """The names that a statement assigns or defines."""
    if isinstance(node, cst.FunctionDef | cst.ClassDef):
        return frozenset({node.name.value})
    targets: list[cst.CSTNode] = []
    if isinstance(node, cst.Assign):
        targets = [target.target for target in node.targets]
    elif isinstance(node, cst.AnnAssign):
        targets = [node.target]
    return frozenset(target.value for target in targets if isinstance(target, cst.Name))
