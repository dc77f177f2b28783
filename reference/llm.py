"""Asking a language model for concepts, at any endpoint that speaks OpenAI's chat completions.

An answer is data: it is parsed and checked, never run. The API key is in no text that this module makes.
"""

from __future__ import annotations

import base64
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import urlsplit

import cv2
import numpy as np

from reference.prompts import NEED_A_PICTURE, complaint_for, labels_in, prompt_for
from reference.vocabulary import LONGEST_TEXT, Vocabulary, complaint_about_text
from tracker.errors import ConfigError, MissingExtraError, VocabularyError

OPENAI_URL = "https://api.openai.com/v1"
VARIABLES = {"base_url": "OPENAI_BASE_URL", "model": "CONCEPTRACK_LLM_MODEL", "api_key": "OPENAI_API_KEY"}
LONGEST_SIDE = 1024  # of the picture that is sent, pixels
SHOWN = 300  # characters of a foreign text in a message


@dataclass(frozen=True, slots=True)
class Endpoint:
    """Where a language model is asked.

    base_url: what "/chat/completions" is appended to. model: its name there. api_key: empty where none is needed.
    timeout_s: without anything arriving. retries: after failures of the network or the server.
    Raises ConfigError for an address, a name or a key that cannot be one.
    """

    base_url: str
    model: str
    api_key: str = field(default="", repr=False)
    timeout_s: float = 120.0
    retries: int = 2

    def __post_init__(self) -> None:
        if complaint := complaint_about_text(self.model, LONGEST_TEXT):
            raise ConfigError(f"name of the language model: {complaint}")
        if not _is_address(self.base_url):
            # not shown: who writes a password into the address does not want to read it here
            raise ConfigError("address of the language model: expected one like https://host/v1, without user or query")
        if not re.fullmatch(r"[!-~]*", self.api_key):
            raise ConfigError("the API key has characters that no key can have, such as spaces or line ends")


def endpoint_from(options: Mapping[str, str | None], environment: Mapping[str, str]) -> Endpoint:
    """An endpoint by options `base_url`, `model` and `api_key`; what is absent or None comes from the environment's
    OPENAI_BASE_URL, CONCEPTRACK_LLM_MODEL and OPENAI_API_KEY. Without an address it is OpenAI's.

    Raises ConfigError that names what is missing. Only an endpoint with an address of its own does without a key.
    """
    if unknown := sorted(options.keys() - VARIABLES.keys()):
        raise ConfigError(f"there is no option {', '.join(unknown)} of an endpoint; there are {', '.join(VARIABLES)}")
    given = {name: options.get(name) for name in VARIABLES}
    found = {name: given[name] or environment.get(variable, "").strip() for name, variable in VARIABLES.items()}
    needed = ("model",) if found["base_url"] else ("model", "api_key")
    if missing := [name for name in needed if not found[name]]:
        told = " and ".join(f"{name} ({VARIABLES[name]} in the environment)" for name in missing)
        raise ConfigError(f"to ask a language model, {told} has to be given")
    return Endpoint(found["base_url"] or OPENAI_URL, found["model"], found["api_key"])


def ask_for_labels(
    category: str, kind: str, count: int, endpoint: Endpoint, picture: np.ndarray | None = None
) -> Vocabulary:
    """Ask a language model for `count` concepts of a category of objects; an answer that cannot be used is sent back
    with a complaint once.

    kind: of prompt, one of `reference.prompts.KINDS`. picture: (H, W, 3) uint8 RGB of such objects; all kinds but
    "default" need one, "default" does not send it.
    Raises ConfigError for a request that cannot be meant, MissingExtraError without the package openai, and
    VocabularyError where the endpoint fails or the second answer cannot be used either.
    """
    content: list[Any] = [{"type": "text", "text": prompt_for(category, kind, count)}]
    if kind in NEED_A_PICTURE:
        if picture is None:
            raise ConfigError(f"prompts of kind {kind!r} need a picture of the object, got none")
        content.append({"type": "image_url", "image_url": {"url": _data_url(picture)}})
    # many servers of text-only models know content as a string only
    messages: list[Any] = [{"role": "user", "content": content if len(content) > 1 else content[0]["text"]}]
    answer = _answer(messages, endpoint)
    try:
        labels = labels_in(answer, count)
    except ValueError as error:
        again = {"role": "user", "content": complaint_for(str(error), count)}
        answer = _answer([*messages, {"role": "assistant", "content": answer}, again], endpoint)
        try:
            labels = labels_in(answer, count)
        except ValueError as error_again:
            complaint, shown = _shown(str(error_again), endpoint), _shown(answer, endpoint)
            raise VocabularyError(
                f"{endpoint.model} gave no labels though asked twice ({complaint}): {shown}"
            ) from None
    return Vocabulary(category, labels, kind, endpoint.model)


def _answer(messages: list[Any], endpoint: Endpoint) -> str:
    """The text that the model answers with."""
    try:
        import openai
    except ImportError as error:
        raise MissingExtraError(
            "asking a language model needs the package openai: pip install 'conceptrack[llm]'"
        ) from error
    model, host = endpoint.model, urlsplit(endpoint.base_url).netloc
    # The causes of these errors hold requests and what servers said of them, the key perhaps among it: they end here.
    try:
        with openai.OpenAI(
            base_url=endpoint.base_url,
            api_key=endpoint.api_key or "none",
            timeout=endpoint.timeout_s,
            max_retries=endpoint.retries,
        ) as client:
            completion: Any = client.chat.completions.create(model=model, messages=messages)
    except openai.APITimeoutError:
        raise VocabularyError(f"{model} at {host} did not answer within {endpoint.timeout_s:g} s") from None
    except openai.APIConnectionError as error:
        raise VocabularyError(f"{host} cannot be reached ({_shown(repr(error.__cause__), endpoint)})") from None
    except openai.APIStatusError as error:
        told = _shown(error.message, endpoint)
        raise VocabularyError(f"{host} answered with HTTP status {error.status_code} ({told})") from None
    except (openai.OpenAIError, ValueError, TypeError, RecursionError) as error:
        told = _shown(str(error), endpoint)
        raise VocabularyError(f"{host} answered with something that is no chat completion ({told})") from None
    try:
        choice = completion.choices[0]
        message, finished = choice.message, choice.finish_reason
        text, refusal = message.content, getattr(message, "refusal", None)
    except (AttributeError, TypeError, IndexError):
        told = _shown(str(completion), endpoint)
        raise VocabularyError(f"{host} answered with something that is no chat completion ({told})") from None
    if refusal or finished == "content_filter":
        raise VocabularyError(f"{model} refused to answer ({_shown(str(refusal or finished), endpoint)})")
    if finished == "length":
        raise VocabularyError(
            f"the answer of {model} was cut off at its limit of length: {_shown(str(text), endpoint)}"
        )
    if not isinstance(text, str):
        raise VocabularyError(f"{model} answered without any text ({_shown(str(finished), endpoint)})")
    return text


def _is_address(url: str) -> bool:
    try:
        parts = urlsplit(url)
        named = bool(parts.hostname) and parts.port != 0
    except ValueError:
        return False
    return named and re.fullmatch(r"https?://[^\s@?#]+", url) is not None


def _shown(text: str, endpoint: Endpoint) -> str:
    """A foreign text for a message: without the key, on one line, shortened."""
    if endpoint.api_key:
        text = text.replace(endpoint.api_key, "(the API key)")
    text = "".join(character if character.isprintable() else " " for character in text)
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}..."


def _data_url(picture: np.ndarray) -> str:
    if picture.dtype != np.uint8 or picture.ndim != 3 or picture.shape[2] != 3 or not picture.size:
        raise ConfigError(
            f"got a picture {picture.shape} of {picture.dtype}, expected (height, width, 3) of uint8, RGB"
        )
    shrink = min(1.0, LONGEST_SIDE / max(picture.shape))
    height, width = (max(1, round(side * shrink)) for side in picture.shape[:2])
    small = cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA) if shrink < 1 else picture
    _, png = cv2.imencode(".png", np.ascontiguousarray(small[..., ::-1]))
    return f"data:image/png;base64,{base64.b64encode(png.tobytes()).decode()}"
