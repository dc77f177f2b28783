"""Asking a language model: a server on this machine answers well, badly, late or not at all, and hears what is sent."""

from __future__ import annotations

import base64
import json
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import cv2
import numpy as np
import pytest

from reference.llm import LONGEST_SIDE, OPENAI_URL, Endpoint, ask_for_labels, endpoint_from
from reference.prompts import NEED_A_PICTURE
from reference.vocabulary import Vocabulary
from tracker.errors import ConfigError, MissingExtraError, VocabularyError

KEY = "sk-secret-0123456789"
GOOD = '["handle", "rim", "base"]'


def completion(content: str | None = GOOD, finish_reason: str = "stop", refusal: str | None = None) -> dict[str, Any]:
    """The body of a chat completion."""
    message = {"role": "assistant", "content": content, "refusal": refusal}
    choice = {"index": 0, "finish_reason": finish_reason, "message": message}
    return {"id": "1", "object": "chat.completion", "created": 0, "model": "gemini", "choices": [choice]}


class Model:
    """A server with answers to give, the last one again and again: (status, body, seconds to wait)."""

    def __init__(self) -> None:
        self.answers: list[tuple[int, Any, float]] = [(200, completion(), 0)]
        self.heard: list[dict[str, Any]] = []
        self.keys: list[str | None] = []
        self.paths: list[str] = []
        outer = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                body = self.rfile.read(int(self.headers["Content-Length"]))
                outer.heard.append(json.loads(body))
                outer.keys.append(self.headers["Authorization"])
                outer.paths.append(self.path)
                status, answer, wait_s = outer.answers.pop(0) if len(outer.answers) > 1 else outer.answers[0]
                time.sleep(wait_s)
                raw = answer if isinstance(answer, bytes) else json.dumps(answer).encode()
                try:
                    self.send_response(status)
                    self.send_header("Content-Type", "application/json")
                    self.send_header("Content-Length", str(len(raw)))
                    self.end_headers()
                    self.wfile.write(raw)
                except ConnectionError:
                    pass  # who asked has gone

            def log_message(self, format: str, *args: Any) -> None:  # noqa: A002
                """Nothing on the terminal."""

        self.server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)

    @property
    def endpoint(self) -> Endpoint:
        return Endpoint(f"http://127.0.0.1:{self.server.server_port}/v1", "gemini", KEY, timeout_s=10, retries=0)

    def gives(self, *bodies: Any, status: int = 200, wait_s: float = 0) -> None:
        self.answers = [(status, body, wait_s) for body in bodies]


@pytest.fixture
def model(monkeypatch: pytest.MonkeyPatch) -> Iterator[Model]:
    monkeypatch.setenv("NO_PROXY", "*")
    model = Model()
    thread = threading.Thread(target=model.server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    yield model
    model.server.shutdown()
    model.server.server_close()
    thread.join()


def refusal_of(endpoint: Endpoint) -> str:
    """What the error says, once it is certain that the key is nowhere in it or behind it."""
    with pytest.raises(VocabularyError) as caught:
        ask_for_labels("mug", "default", 3, endpoint)
    error: BaseException | None = caught.value
    assert error is not None
    assert error.__suppress_context__ or error.__context__ is None
    assert error.__cause__ is None
    assert KEY not in str(error)
    assert "sk-" not in str(error)
    assert str(error).isprintable()
    assert len(str(error)) < 600
    return str(error)


def test_a_good_answer_becomes_a_vocabulary(model: Model) -> None:
    vocabulary = ask_for_labels("mug", "default", 3, model.endpoint)
    assert vocabulary == Vocabulary("mug", ("handle", "rim", "base"), "default", "gemini")
    (heard,) = model.heard
    assert model.paths == ["/v1/chat/completions"]
    assert model.keys == [f"Bearer {KEY}"]
    assert heard["model"] == "gemini"
    (message,) = heard["messages"]
    assert message["role"] == "user"
    assert "mug" in message["content"]
    assert "exactly 3" in message["content"]
    assert KEY not in json.dumps(heard)


def test_a_fenced_answer_is_good_too(model: Model) -> None:
    model.gives(completion(f"```json\n{GOOD}\n```"))
    assert ask_for_labels("mug", "default", 3, model.endpoint).labels == ("handle", "rim", "base")


@pytest.mark.parametrize(
    ("bad", "complaint"),
    [
        ('["handle", "rim"]', "got 2 labels, expected exactly 3"),
        ('["handle", "rim", "Rim"]', "'rim' appears more than once"),
        ("Certainly! handle, rim, base", "not a JSON list"),
    ],
)
def test_a_bad_answer_is_sent_back_with_the_complaint_once(model: Model, bad: str, complaint: str) -> None:
    model.gives(completion(bad), completion())
    assert ask_for_labels("mug", "default", 3, model.endpoint).labels == ("handle", "rim", "base")
    first, second = (heard["messages"] for heard in model.heard)
    assert second[:-2] == first
    assert second[-2] == {"role": "assistant", "content": bad}
    assert second[-1]["role"] == "user"
    assert complaint in second[-1]["content"]


def test_two_bad_answers_are_an_error_that_shows_the_last_one_shortened(model: Model) -> None:
    model.gives(completion("first"), completion("second\x1b[31m [bold]" + "and so on " * 200 + "END"))
    told = refusal_of(model.endpoint)
    assert len(model.heard) == 2
    assert told.startswith("gemini gave no labels though asked twice (it is not a JSON list): second [31m [bold]and so")
    assert told.endswith("...")
    assert "END" not in told


def test_a_key_that_the_model_answers_with_is_not_shown(model: Model) -> None:
    model.gives(completion("x" * 290 + KEY))  # not even the beginning that shortening would leave
    assert "x(the API" in refusal_of(model.endpoint)


@pytest.mark.parametrize(
    ("body", "told"),
    [
        (completion(None, refusal="I'd rather not"), r"gemini refused to answer (I'd rather not)"),
        (completion("", "content_filter"), "gemini refused to answer (content_filter)"),
        (completion(None), "gemini answered without any text (stop)"),
        (completion('["handle", "ri', "length"), "the answer of gemini was cut off at its limit of length"),
        (completion(GOOD, "length"), "the answer of gemini was cut off at its limit of length"),
        ({"choices": []}, "answered with something that is no chat completion"),
        ({"choices": None}, "answered with something that is no chat completion"),
        ({"choices": [{}]}, "answered with something that is no chat completion"),
        ({"choices": ["rim"]}, "answered with something that is no chat completion"),
        ({"error": f"what is {KEY}?"}, "answered with something that is no chat completion"),
        ([1, 2], "answered with something that is no chat completion"),
        ("labels", "answered with something that is no chat completion"),
        (None, "answered with something that is no chat completion"),
        (b"<html>not found</html>", "answered with something that is no chat completion"),
        (b'{"choices": [', "answered with something that is no chat completion"),
        (b"\xff\xfe\x00", "answered with something that is no chat completion"),
        (b"[" * 100_000, "answered with something that is no chat completion"),
        (b"", "answered with something that is no chat completion"),
    ],
)
def test_what_is_no_answer_is_an_error_at_once(model: Model, body: Any, told: str) -> None:
    model.gives(body)
    assert told in refusal_of(model.endpoint)
    assert len(model.heard) == 1


@pytest.mark.parametrize("status", [400, 401, 403, 404, 413, 429, 500, 503])
def test_a_status_of_failure_is_named_with_what_the_server_says_and_without_the_key(model: Model, status: int) -> None:
    model.gives({"error": {"message": f"Incorrect API key provided: {KEY}."}}, status=status)
    told = refusal_of(model.endpoint)
    assert f"127.0.0.1:{model.server.server_port} answered with HTTP status {status} (" in told
    assert "Incorrect API key provided: (the API key)" in told
    model.gives(b"\x00garbage", status=status)
    assert f"HTTP status {status}" in refusal_of(model.endpoint)


def test_a_failure_of_the_server_is_tried_again_as_often_as_the_endpoint_says(model: Model) -> None:
    model.answers = [(500, {}, 0), (200, completion(), 0)]
    assert ask_for_labels("mug", "default", 3, replace(model.endpoint, retries=1)).labels
    assert len(model.heard) == 2


def test_a_server_that_is_late_is_not_waited_for(model: Model) -> None:
    model.gives(completion(), wait_s=1.0)
    start = time.monotonic()
    assert "did not answer within 0.2 s" in refusal_of(replace(model.endpoint, timeout_s=0.2))
    assert time.monotonic() - start < 0.9


@pytest.mark.parametrize("url", ["http://127.0.0.1:1/v1", "http://nobody.invalid/v1"])
def test_a_server_that_is_not_there_is_named(model: Model, url: str) -> None:
    assert f"{url[7:-3]} cannot be reached (Connect" in refusal_of(replace(model.endpoint, base_url=url))


@pytest.mark.parametrize("kind", sorted(NEED_A_PICTURE))
def test_a_picture_goes_along_with_the_kinds_that_need_one(model: Model, kind: str) -> None:
    picture = np.random.default_rng(0).integers(0, 256, (7, 5, 3), np.uint8)
    assert ask_for_labels("mug", kind, 3, model.endpoint, picture).kind == kind
    text, image = model.heard[0]["messages"][0]["content"]
    assert "mug" in text["text"]
    np.testing.assert_array_equal(sent_picture(image), picture)
    with pytest.raises(ConfigError, match=f"prompts of kind '{kind}' need a picture of the object, got none"):
        ask_for_labels("mug", kind, 3, model.endpoint)
    assert len(model.heard) == 1


def sent_picture(image: dict[str, Any]) -> np.ndarray:
    head, _, data = image["image_url"]["url"].partition(",")
    assert (image["type"], head) == ("image_url", "data:image/png;base64")
    bgr = cv2.imdecode(np.frombuffer(base64.b64decode(data), np.uint8), cv2.IMREAD_COLOR)
    assert bgr is not None
    return bgr[..., ::-1]


def test_a_large_picture_is_sent_smaller_and_the_default_prompt_sends_none(model: Model) -> None:
    picture = np.full((30, 3 * LONGEST_SIDE, 3), 77, np.uint8)
    ask_for_labels("mug", "geometric", 3, model.endpoint, picture)
    assert sent_picture(model.heard[0]["messages"][0]["content"][1]).shape == (10, LONGEST_SIDE, 3)
    ask_for_labels("mug", "default", 3, model.endpoint, picture)
    assert isinstance(model.heard[1]["messages"][0]["content"], str)


@pytest.mark.parametrize(
    "picture",
    [np.zeros((4, 4), np.uint8), np.zeros((4, 4, 4), np.uint8), np.zeros((4, 4, 3)), np.zeros((0, 4, 3), np.uint8)],
)
def test_a_picture_that_is_none_is_refused(model: Model, picture: np.ndarray) -> None:
    with pytest.raises(ConfigError, match=r"expected \(height, width, 3\) of uint8"):
        ask_for_labels("mug", "geometric", 3, model.endpoint, picture)
    assert model.heard == []


def test_nothing_is_asked_that_cannot_be_meant(model: Model) -> None:
    for request in (("", "default", 3), ("mug", "poem", 3), ("mug", "default", 0)):
        with pytest.raises(ConfigError):
            ask_for_labels(*request, model.endpoint)
    assert model.heard == []


def test_without_the_package_the_extra_is_named(model: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "openai", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'conceptrack\[llm\]'"):
        ask_for_labels("mug", "default", 3, model.endpoint)


def test_an_endpoint_does_not_show_its_key() -> None:
    endpoint = Endpoint("https://host/v1", "gemini", KEY)
    assert KEY not in f"{endpoint!r} {endpoint!s} {endpoint}"
    assert "https://host/v1" in repr(endpoint)


@pytest.mark.parametrize(
    "change",
    [
        *({"base_url": url} for url in ("", "host/v1", "ftp://host", "https://", "http://a b/", "http://[::1/v1")),
        *(
            {"base_url": url}
            for url in (f"https://me:{KEY}@host/v1", f"https://host/v1?key={KEY}", "http://h:99999/v1")
        ),
        *({"api_key": key} for key in (f"{KEY}\n", f" {KEY}", f"{KEY}é")),
        *({"model": name} for name in ("", "a\nb", "m" * 201)),
    ],
)
def test_what_is_no_endpoint_is_refused_without_telling_secrets(change: dict[str, str]) -> None:
    with pytest.raises(ConfigError) as caught:
        replace(Endpoint("https://host/v1", "gemini", "other"), **change)  # pyright: ignore[reportArgumentType]
    assert KEY not in str(caught.value)


ENVIRONMENT = {"OPENAI_BASE_URL": "http://there/v1", "OPENAI_API_KEY": f"{KEY}\n", "CONCEPTRACK_LLM_MODEL": "gemini"}


def test_what_no_option_says_the_environment_says() -> None:
    assert endpoint_from({}, ENVIRONMENT) == Endpoint("http://there/v1", "gemini", KEY)
    given = {"base_url": "http://here/v1", "model": "qwen", "api_key": "mine"}
    assert endpoint_from(given, ENVIRONMENT) == Endpoint("http://here/v1", "qwen", "mine")
    assert endpoint_from({"base_url": None, "model": "qwen"}, ENVIRONMENT).model == "qwen"
    assert endpoint_from({}, {**ENVIRONMENT, "OPENAI_BASE_URL": ""}).base_url == OPENAI_URL


def test_a_server_of_one_s_own_needs_no_key(model: Model) -> None:
    endpoint = endpoint_from({"base_url": model.endpoint.base_url, "model": "qwen"}, {})
    assert endpoint.api_key == ""
    assert ask_for_labels("mug", "default", 3, endpoint).source == "qwen"


@pytest.mark.parametrize(
    ("without", "told"),
    [
        (("CONCEPTRACK_LLM_MODEL",), r"model \(CONCEPTRACK_LLM_MODEL in the environment\) has to be given"),
        (("OPENAI_BASE_URL", "OPENAI_API_KEY"), r"api_key \(OPENAI_API_KEY in the environment\) has to be given"),
        (tuple(ENVIRONMENT), "model .* and api_key .* has to be given"),
    ],
)
def test_what_is_missing_is_named_with_its_variable(without: tuple[str, ...], told: str) -> None:
    with pytest.raises(ConfigError, match=told):
        endpoint_from({}, {name: value for name, value in ENVIRONMENT.items() if name not in without})
    with pytest.raises(ConfigError, match="no option key of an endpoint; there are base_url, model, api_key"):
        endpoint_from({"key": KEY}, ENVIRONMENT)
