"""Kept answers: asked for once, edited by hand from then on, and never outside of their folder."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference import vocabulary_cache
from reference.llm import Endpoint
from reference.vocabulary import Vocabulary, read_vocabulary
from reference.vocabulary_cache import cache_folder, cache_slug, cached_vocabulary
from tracker.errors import ConfigError

ENDPOINT = Endpoint("http://127.0.0.1:1/v1", "gemini")
TEXTS = st.text() | st.sampled_from(["..", "../../etc/passwd", "/", "C:\\x", ".", "~", "a\0b", "con", "-rf", "\ud800"])


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, str, int, str]]:
    """What a model that always has labels has been asked."""
    asked = []

    def ask(category: str, kind: str, count: int, endpoint: Endpoint, _: object) -> Vocabulary:
        asked.append((category, kind, count, endpoint.model))
        return Vocabulary(category, tuple(f"part {n}" for n in range(count)), kind, endpoint.model)

    monkeypatch.setattr(vocabulary_cache, "ask_for_labels", ask)
    return asked


def test_the_same_is_asked_once(asked: list[tuple[str, str, int, str]], tmp_path: Path) -> None:
    first = cached_vocabulary("mug", "default", 3, ENDPOINT, folder=tmp_path)
    assert cached_vocabulary("mug", "default", 3, ENDPOINT, folder=tmp_path) == first
    assert cached_vocabulary("Mug", "default", 3, ENDPOINT, folder=tmp_path) == first
    assert len(asked) == len(list(tmp_path.iterdir())) == 1


def test_another_category_kind_count_or_model_is_asked_anew(
    asked: list[tuple[str, str, int, str]], tmp_path: Path
) -> None:
    requests = [
        ("mug", "default", 3, "gemini"),
        ("bowl", "default", 3, "gemini"),
        ("mug", "geometric", 3, "gemini"),
        ("mug", "default", 4, "gemini"),
        ("mug", "default", 3, "gemini!"),
    ]
    for category, kind, count, model in requests * 2:
        cached_vocabulary(category, kind, count, Endpoint(ENDPOINT.base_url, model), folder=tmp_path)
    assert asked == requests


def test_what_a_person_edits_is_what_is_used(asked: list[tuple[str, str, int, str]], tmp_path: Path) -> None:
    cached_vocabulary("mug", "default", 3, ENDPOINT, folder=tmp_path)
    (file,) = tmp_path.iterdir()
    assert file.name.startswith("mug-default-3-gemini-")
    assert read_vocabulary(str(file)).for_object("mug").source == "gemini"
    file.write_text(file.read_text().replace("- part 1\n", "- ear\n").replace("  - part 2\n", ""))
    assert cached_vocabulary("mug", "default", 3, ENDPOINT, folder=tmp_path).labels == ("part 0", "ear")
    file.write_text("labels: [")
    with pytest.raises(ConfigError, match=re.escape(str(file))):
        cached_vocabulary("mug", "default", 3, ENDPOINT, folder=tmp_path)
    assert len(asked) == 1


def test_an_answer_that_cannot_be_kept_is_given_all_the_same(
    asked: list[tuple[str, str, int, str]], tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "file").write_text("")
    assert cached_vocabulary("mug", "default", 3, ENDPOINT, folder=tmp_path / "file").labels
    assert "cannot be written" in caplog.text
    assert len(asked) == 1


def test_what_cannot_be_meant_is_refused_before_anything_is_read(tmp_path: Path) -> None:
    for request in (("../mug\n", "default", 3), ("mug", "../default", 3), ("mug", "default", -3)):
        with pytest.raises(ConfigError):
            cached_vocabulary(*request, ENDPOINT, folder=tmp_path / "new")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("asked")
def test_answers_are_kept_where_caches_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    cached_vocabulary("mug", "default", 3, ENDPOINT)
    assert len(list((tmp_path / "conceptrack" / "vocabularies").glob("mug-*.yaml"))) == 1
    at_home = Path.home() / ".cache" / "conceptrack" / "vocabularies"
    assert cache_folder({}) == cache_folder({"XDG_CACHE_HOME": "relative"}) == at_home


@given(category=TEXTS, kind=TEXTS, count=st.integers(), model=TEXTS)
def test_no_text_leads_out_of_the_folder(category: str, kind: str, count: int, model: str) -> None:
    slug = cache_slug(category, kind, count, model)
    assert re.fullmatch(r"[a-z0-9][a-z0-9-]{0,99}", slug)
    assert (Path("/cache") / f"{slug}.yaml").resolve().parent == Path("/cache").resolve()


def test_texts_that_read_alike_have_files_of_their_own() -> None:
    texts = ["mug", "mug!", "マグ", "カップ", "m" * 90 + "a", "m" * 90 + "b"]
    slugs = {cache_slug(category, "default", 20, "gemini") for category in texts}
    assert len(slugs) == len(texts)
    assert cache_slug("a", "b-c", 2, "d") != cache_slug("a-b", "c", 2, "d")
