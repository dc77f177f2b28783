"""The directive `error-list`: every message with which this project refuses something, read from its code."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("tracker", "reference", "eval")
ERRORS = ROOT / "tracker" / "errors.py"


class Message(NamedTuple):
    """kind: class of the error. text: with names in angle brackets for what differs. module: where it is made. line."""

    kind: str
    text: str
    module: str
    line: int

    @property
    def is_passed_on(self) -> bool:
        """The words are another's: there are none here."""
        return not re.search(r"[a-z]{3}", re.sub(r"<[^>]*>", "", self.text))


def kinds() -> dict[str, str]:
    """The errors of this project but their base, with what they are."""
    classes = [node for node in ast.parse(ERRORS.read_text()).body if isinstance(node, ast.ClassDef)]
    return {node.name: ast.get_docstring(node) or "" for node in classes if node.name != "TrackerError"}


def messages() -> list[Message]:
    """Of all errors of these kinds that the code makes, in the order of files and lines."""
    paths = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
    return [message for path in paths for message in _messages_in(path)]


def module_of(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def _messages_in(path: Path) -> Iterator[Message]:
    known, module = kinds(), module_of(path)
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in known:
            yield Message(node.func.id, " ".join(_text(node.args[0]).split()), module, node.lineno)


def _text(node: ast.expr) -> str:
    match node:
        case ast.Constant(value=str(text)):
            return text
        case ast.JoinedStr(values=parts):
            return "".join(map(_text, parts))
        case ast.FormattedValue(value=value):
            return _text(value)
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            return _text(left) + _text(right)
        case ast.Name(id=name) | ast.Attribute(attr=name):
            return f"<{name.strip('_').replace('_', ' ')}>"
        case ast.Call(func=ast.Attribute(value=ast.Constant(), attr="join")):
            return "<list>"
    return "<..>"


class ErrorList(SphinxDirective):
    """A section a kind of error, in it the messages by module."""

    def run(self) -> list[nodes.Node]:
        told = [message for message in messages() if not message.is_passed_on]
        for path in ROOT.glob("*/errors.py"):
            self.env.note_dependency(str(path))
        return [self._section(kind, what, [m for m in told if m.kind == kind]) for kind, what in kinds().items()]

    def _section(self, kind: str, what: str, told: list[Message]) -> nodes.section:
        section = nodes.section(ids=[kind.lower()], names=[kind.lower()])
        section += nodes.title(kind, kind)
        section += nodes.paragraph(what, what)
        for module in dict.fromkeys(message.module for message in told):
            section += nodes.paragraph("", "", nodes.strong(module, module))
            texts = dict.fromkeys(message.text for message in told if message.module == module)
            items = [nodes.list_item("", nodes.paragraph("", "", nodes.literal(text, text))) for text in texts]
            section += nodes.bullet_list("", *items)
        return section


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_directive("error-list", ErrorList)
    return {"parallel_read_safe": True}
