"""Keys and tokens are in no log, however much is logged, and in nothing that a run leaves behind."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path

import pytest

import reference.__main__
import tracker.__main__
from tests.test_llm import KEY, Model, completion, model

__all__ = ["model"]  # a fixture

TOKEN = "a-token-that-nobody-guesses"  # noqa: S105 - what is looked for
SCENE = "synthetic:turn?size=160x120&object=soup_can&frames=4"
LABELS = '["red", "white", "curved", "rim"]'


@pytest.fixture(autouse=True)
def secrets(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    """In the environment, while everybody says all that there is to say."""
    monkeypatch.setenv("OPENAI_API_KEY", KEY)
    monkeypatch.setenv("CONCEPTRACK_TOKEN", TOKEN)
    caplog.set_level(logging.DEBUG)


def assert_untold(said: str, folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    left = {path.name: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    assert left
    for secret in (KEY, TOKEN):
        assert secret not in said
        assert secret not in caplog.text
        assert [name for name, content in left.items() if secret.encode() in content] == []


def test_a_language_model_is_asked_and_its_key_stays_here(
    model: Model,
    program: Callable[..., tuple[int, str]],
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("OPENAI_BASE_URL", model.endpoint.base_url)
    model.gives(completion(LABELS))
    asked = ("--ask.category", "can", "--ask.concepts", "4", "--ask.model", "gemini")
    options = ("--object", "soup_can", "--views", "2", *asked, "--out", tmp_path / "can.concept")
    code, said = program(reference.__main__.main, SCENE.replace("&frames=4", ""), *options)
    assert (code, model.keys) == (0, [f"Bearer {KEY}"]), said
    assert_untold(said, tmp_path, caplog)


def test_a_run_with_a_page_is_saved_without_its_token(
    can_file: Path, program: Callable[..., tuple[int, str]], tmp_path: Path, caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.setattr("tracker.web.server.WebPage.stay", lambda *_: None)
    options = ("--model", can_file, "--out", tmp_path / "out", "--serve", "0.0.0.0:0", "--view", "frames")
    code, said = program(tracker.__main__.main, SCENE, *options)
    assert code == 0, said
    assert (tmp_path / "out" / "run.json").is_file()
    assert_untold(said, tmp_path, caplog)
