"""What a language model is asked for, and what of its answer is accepted.

The four kinds of prompt are those of the paper's ablation: "default" for parts by their names, "geometric" for places
on the shape, "affordance" for what can be done where, "adjective" for parts with a word that describes them.
"""

from __future__ import annotations

import json

from reference.vocabulary import LONGEST_LABEL, LONGEST_TEXT, complaint_about_labels, complaint_about_text
from tracker.errors import ConfigError

MOST_LABELS = 100
KINDS = {
    "default": (
        "Name parts and features by the words that people use most for them, one to three words each, such as "
        '"handle" or "spout". Do not say where they are: no "left", "upper" or "front".'
    ),
    "geometric": (
        "Describe places on the shape: which part, and where on it or along which curve, edge or axis, in three to "
        'seven words each, such as "top of the handle\'s curve".'
    ),
    "affordance": (
        "Describe places by what can be done there and by their shape, in three to seven words each, such as "
        '"pourable narrow tip of the spout".'
    ),
    "adjective": (
        "Name parts with an adjective that describes them, two or three words each, such as "
        '"curved handle" or "graspable body".'
    ),
}
NEED_A_PICTURE = frozenset(KINDS) - {"default"}
REQUEST = """\
List {count} visual concepts of this kind of object: {category}.
Each will be searched for in pictures, to find out where on the object it is. Therefore:
- they hold for any object of this kind, not for one specimen only;
- each can be seen on the outside from at least one direction;
- they mean different things and lie in different places, so that no two mark the same spot.
{kind}{picture}
Answer with nothing but a JSON list of exactly {count} strings, no two alike, none longer than {longest} characters."""
PICTURE = "\nThe picture shows objects of this kind; use it to see what they look like."
AGAIN = "That cannot be used: {complaint}. Answer again, as a JSON list of exactly {count} distinct strings."


def check_request(category: str, kind: str, count: int) -> None:
    """Raises ConfigError where there is no such kind of prompt, and for a category or a count that cannot be meant."""
    if kind not in KINDS:
        raise ConfigError(f"there is no kind of prompt {kind!r}; expected one of {', '.join(KINDS)}")
    if complaint := complaint_about_text(category, LONGEST_TEXT):
        raise ConfigError(f"the category of the object: {complaint}")
    if not 1 <= count <= MOST_LABELS:
        raise ConfigError(f"got {count} as the number of labels, expected 1 to {MOST_LABELS}")


def prompt_for(category: str, kind: str, count: int) -> str:
    """The text that asks for the labels of a category. Raises ConfigError as `check_request` does."""
    check_request(category, kind, count)
    picture = PICTURE if kind in NEED_A_PICTURE else ""
    return REQUEST.format(category=category, kind=KINDS[kind], picture=picture, count=count, longest=LONGEST_LABEL)


def complaint_for(complaint: str, count: int) -> str:
    """The text that asks once more, after an answer that could not be used."""
    return AGAIN.format(complaint=complaint, count=count)


def labels_in(answer: str, count: int) -> tuple[str, ...]:
    """The labels in an answer: a JSON list, with or without a fence of ``` around it, of that many distinct short
    strings. Spaces around labels are dropped. Raises ValueError that says what else it is."""
    text = answer.strip()
    if len(text) > 6 and text.startswith("```") and text.endswith("```"):
        text = text[3:-3].removeprefix("json")
    try:
        labels = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ValueError("it is not a JSON list") from error
    if isinstance(labels, list):
        labels = [label.strip() if isinstance(label, str) else label for label in labels]
    if complaint := complaint_about_labels(labels, count):
        raise ValueError(complaint)
    return tuple(labels)
