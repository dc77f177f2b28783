"""The page of errors: the list that is read from the code has all of them, and every cure is of one of them."""

from __future__ import annotations

import ast
import importlib
import re
from pathlib import Path
from types import ModuleType

import pytest

import tracker.errors
from tracker.errors import TrackerError

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs" / "errors.md").read_text()
FILES = sorted(path for package in ("tracker", "reference", "eval") for path in (ROOT / package).rglob("*.py"))


@pytest.fixture
def error_list(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    return importlib.import_module("error_list")


def test_every_kind_of_error_has_messages(error_list: ModuleType) -> None:
    of_code = {name for name, found in vars(tracker.errors).items() if isinstance(found, type)} - {"TrackerError"}
    assert set(error_list.kinds()) == of_code
    assert {message.kind for message in error_list.messages()} == of_code


def test_every_line_that_raises_one_is_in_the_list(error_list: ModuleType) -> None:
    """Found in another way: by the text of the lines."""
    kinds = "|".join(error_list.kinds())
    listed = [(message.module, message.line) for message in error_list.messages()]
    for path in FILES:
        module = error_list.module_of(path)
        for number, line in enumerate(path.read_text().splitlines(), start=1):
            if re.search(rf"^\s*raise ({kinds})\(", line):
                assert (module, number) in listed, f"{path}:{number}"


def test_only_what_repeats_another_error_or_names_settings_is_left_out(error_list: ModuleType) -> None:
    left_out = {message.text for message in error_list.messages() if message.is_passed_on}
    assert left_out <= {
        "<list>", "<why>", "<ended>", "<what>: <complaint>", "<name>: <raised>",
        *(f"<{where}>: <error>" for where in ("where", "path", "annotation", "told by")),
    }  # fmt: skip


def test_a_message_is_words_with_names_for_what_differs(error_list: ModuleType) -> None:
    texts = {message.text for message in error_list.messages()}
    assert "<where>: <name> has dtype <dtype>, expected <..>" in texts
    assert all(text and "\n" not in text for text in texts)


def test_every_cure_is_of_words_that_the_code_can_say() -> None:
    said = {
        node.value
        for path in FILES
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    }
    cured = re.findall(r"^\*\*`([^`]+)`\*\*|, \*\*`([^`]+)`\*\*", PAGE, re.MULTILINE)
    assert len(cured) > 10
    assert [words for pair in cured for words in pair if words and not any(words in text for text in said)] == []


def test_all_errors_are_children_of_one() -> None:
    for found in vars(tracker.errors).values():
        assert not isinstance(found, type) or issubclass(found, TrackerError)
