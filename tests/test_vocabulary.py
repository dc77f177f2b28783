"""Vocabularies: what is shipped is whole, what is written is read as it was, what is no vocabulary is named."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import FrozenInstanceError
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from reference.vocabulary import (
    HEADER,
    LONGEST_LABEL,
    SHIPPED,
    Vocabulary,
    VocabularySet,
    plain_name,
    read_vocabulary,
    shipped_vocabularies,
    write_vocabulary,
)
from tracker.errors import ConfigError, OutputError
from tracker.saliency.vision_language import GENERAL_LABELS
from tracker.yaml_files import LARGEST_FILE

MUG = Vocabulary("mug", ("handle", "rim"), ids=("14", "025_mug"))
BOWL = Vocabulary("bowl", ("rim", "foot"), ids=("13", "024_bowl"))
ONE_LINE = st.text(st.characters(exclude_categories=("C", "Z")) | st.just(" "), min_size=1, max_size=40)
TEXT = ONE_LINE.map(str.strip).filter(lambda text: bool(text) and text.isprintable())
LABELS = st.lists(TEXT, min_size=1, max_size=12, unique_by=str.casefold).map(tuple)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "mine.yaml"


@pytest.mark.parametrize(
    ("name", "objects"), [("general", 0), ("linemod", 15), ("real275", 6), ("toyota-light", 21), ("ycbv", 21)]
)
def test_what_is_shipped_has_twenty_short_labels_for_every_object(name: str, objects: int) -> None:
    shipped = read_vocabulary(name)
    assert shipped.name == name
    numbers = [one for vocabulary in shipped.vocabularies for one in vocabulary.ids if one.isdecimal()]
    assert numbers == [str(number) for number in range(1, objects + 1)]
    for vocabulary in shipped.vocabularies:
        assert len(vocabulary.labels) == 20, vocabulary.category
        assert all(len(label.replace("_", " ").split()) <= 4 for label in vocabulary.labels), vocabulary.category
        assert vocabulary.kind == "default"


def test_every_shipped_file_is_tested_and_says_where_its_labels_come_from() -> None:
    assert shipped_vocabularies() == ("general", "linemod", "real275", "toyota-light", "ycbv")
    sources = {name: {one.source for one in read_vocabulary(name).vocabularies} for name in shipped_vocabularies()}
    assert sources.pop("real275") == {"ConceptPose paper"}
    assert set().union(*sources.values()) == {"shipped"}
    assert all((SHIPPED / f"{name}.yaml").read_text().startswith("# ") for name in shipped_vocabularies())


def test_real275_has_the_labels_of_the_paper_as_they_are_printed() -> None:
    real275 = read_vocabulary("real275")
    assert [one.category for one in real275.vocabularies] == ["bottle", "bowl", "camera", "can", "laptop", "mug"]
    assert real275.for_object("bottle").labels[13:] == (
        *("threads", "tamper_evident_ring", "overcap", "sleeve", "collar", "punt", "carry_loop"),
    )
    assert real275.for_object("mug").labels[-3:] == ("carrying_loop", "vent_hole", "spout_cover")


@pytest.mark.parametrize(
    ("name", "object_id", "category"),
    [
        ("ycbv", "5", "mustard bottle"),
        ("ycbv", "006_mustard_bottle", "mustard bottle"),
        ("ycbv", "Mustard-Bottle", "mustard bottle"),
        ("ycbv", "20", "extra large clamp"),
        ("linemod", "benchvise", "bench vise"),
        ("linemod", "5", "watering can"),
        ("real275", "laptop", "laptop"),
        ("toyota-light", "21", "household object"),
        ("toyota-light", "remote_control", "remote control"),
        ("general", "anything at all", "household object"),
    ],
)
def test_an_object_is_found_by_its_number_its_name_and_its_category(name: str, object_id: str, category: str) -> None:
    assert read_vocabulary(name).for_object(object_id).category == category


def test_an_instance_is_found_by_the_category_that_it_is_told_to_be_of_after_its_own_name() -> None:
    two = VocabularySet("two", (MUG, BOWL))
    assert two.for_object("bowl_shaped_mug", "Mug") is MUG
    assert two.for_object("bowl", "mug") is BOWL  # what is said of the object itself comes first
    with pytest.raises(ConfigError, match="none for object 'mug_daniel'; there are"):
        two.for_object("mug_daniel")  # nothing is guessed from a name
    with pytest.raises(ConfigError, match="none for object 'mug_daniel' of category 'cup'; there are"):
        two.for_object("mug_daniel", "cup")


def test_an_unknown_object_is_answered_with_those_that_there_are() -> None:
    with pytest.raises(ConfigError, match="'two' has none for object 'spoon'; there are 14 = 025_mug = mug, 13 = "):
        VocabularySet("two", (MUG, BOWL)).for_object("spoon")
    with pytest.raises(ConfigError, match="none for object 'bowl'"):
        VocabularySet("one", (MUG,)).for_object("bowl")  # it is for certain objects, so not for any
    with pytest.raises(ConfigError, match="none for object ''"):
        VocabularySet("two", (MUG, Vocabulary("_", ("rim",)))).for_object("")


def test_two_vocabularies_do_not_answer_to_one_name() -> None:
    with pytest.raises(ConfigError, match="several answer to '14'"):
        VocabularySet("two", (MUG, Vocabulary("cup", ("rim",), ids=("14",))))
    with pytest.raises(ConfigError, match="several answer to 'mug'"):
        VocabularySet("two", (MUG, Vocabulary("Mug", ("rim",))))
    with pytest.raises(ConfigError, match="expected at least one"):
        VocabularySet("none", ())


@pytest.mark.parametrize(
    ("labels", "complaint"),
    [
        ((), r"labels: got \(\), expected a list of at least one label"),
        (("rim", "lid", "Rim"), "labels: 'rim' appears more than once"),
        (("rim", ""), "label 2: got an empty text"),
        (("rim", "  "), "label 2: got an empty text"),
        ((" rim",), "label 1: ' rim' has control characters or spaces around it"),
        (("rim\x1b[31m",), "label 1: .* has control characters"),
        (("a\nb",), "label 1: .* has control characters"),
        (("\u202erim",), "label 1: .* has control characters"),
        (("r" * (LONGEST_LABEL + 1),), "has 65 characters, expected at most 64"),
        ((7,), "label 1: got 7, expected text"),
        ((True,), "label 1: got True, expected text"),
    ],
)
def test_labels_that_cannot_be_used_are_refused(labels: tuple[str, ...], complaint: str) -> None:
    with pytest.raises(ConfigError, match=complaint):
        Vocabulary("mug", labels)


def test_a_label_of_the_greatest_length_is_fine_and_nothing_changes_in_place() -> None:
    vocabulary = Vocabulary("mug", ("r" * LONGEST_LABEL,))
    with pytest.raises(FrozenInstanceError):
        vocabulary.kind = "geometric"  # pyright: ignore[reportAttributeAccessIssue]
    for wrong in ({"category": ""}, {"kind": "a\tb"}, {"source": "s" * 201}, {"ids": ("1", "")}):
        with pytest.raises(ConfigError, match=f"^{next(iter(wrong))}: "):
            Vocabulary(**{"category": "mug", "labels": ("rim",), **wrong})


@given(data=st.data(), name=TEXT)
def test_what_is_written_is_read_as_it_was(
    data: st.DataObject, name: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    names = data.draw(st.lists(TEXT, min_size=1, max_size=6, unique_by=plain_name))
    names = [one for one in names if plain_name(one)] or ["mug"]
    vocabularies = tuple(
        Vocabulary(category, data.draw(LABELS), data.draw(TEXT), data.draw(TEXT), (f"{number:06d}",))
        for number, category in enumerate(names, 900_000)
    )
    path = tmp_path_factory.getbasetemp() / "round trip.yaml"
    write_vocabulary(path, VocabularySet(name, vocabularies))
    assert read_vocabulary(str(path)) == VocabularySet(name, vocabularies)


def test_a_written_file_can_be_edited_by_a_person(file: Path) -> None:
    write_vocabulary(file, VocabularySet("mine", (MUG, BOWL)))
    text = file.read_text()
    assert text.startswith(HEADER)
    assert "\n  - handle\n  - rim\n" in text
    file.write_text(text.replace("  - handle\n", "  - Henkelgriff\n  - ear # as on a pot\n"))
    assert read_vocabulary(str(file)).for_object("mug").labels == ("Henkelgriff", "ear", "rim")


def test_a_file_by_hand_needs_next_to_nothing(file: Path) -> None:
    file.write_text("vocabularies:\n- {category: mug, ids: [14], labels: [handle, rim]}\n")
    expected = Vocabulary("mug", ("handle", "rim"), "default", "mine.yaml", ("14",))
    assert read_vocabulary(str(file)) == VocabularySet("mine", (expected,))


def test_a_file_is_written_whole_or_not_at_all(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_vocabulary(file, VocabularySet("mine", (MUG,)))
    before = file.read_bytes()

    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", fail)
    with pytest.raises(OutputError, match=r"mine\.yaml: cannot be written \(No space left on device\)"):
        write_vocabulary(file, VocabularySet("mine", (BOWL,)))
    assert file.read_bytes() == before
    assert list(file.parent.iterdir()) == [file]


def test_a_place_where_nothing_can_be_written_is_named(file: Path) -> None:
    file.write_text("")
    with pytest.raises(OutputError, match=r"mine\.yaml/deep\.yaml: cannot be written"):
        write_vocabulary(file / "deep.yaml", VocabularySet("mine", (MUG,)))


def test_an_unknown_vocabulary_is_answered_with_the_shipped_ones(tmp_path: Path) -> None:
    for name in ("ycb", "../vocabularies/ycbv", str(tmp_path), "", "a\0b"):
        with pytest.raises(ConfigError, match="expected a file, or one of general, linemod, real275, toyota-light, y"):
            read_vocabulary(name)
    with pytest.raises(ConfigError, match="cannot be read"):
        read_vocabulary("y" * 5000)


def one(**changes: object) -> dict[str, object]:
    return {"vocabularies": [{"category": "mug", "labels": ["rim"], **changes}]}


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        ([], r"the file: got \[\], expected a mapping with name, vocabularies"),
        ("mug", "the file: got 'mug', expected a mapping"),
        (None, "the file: got None, expected a mapping"),
        ({"labels": ["rim"]}, "the file: there is no key 'labels'; there are name, vocabularies"),
        ({"name": "mine"}, "vocabularies: got None, expected a list"),
        ({"vocabularies": []}, "vocabularies: there are none"),
        ({"vocabularies": {"mug": ["rim"]}}, "vocabularies: got {'mug'.*}, expected a list"),
        ({"vocabularies": ["mug"]}, "vocabulary 1: got 'mug', expected a mapping with category, ids, kind"),
        ({**one(), "name": 7}, "name: got 7, expected text"),
        (one(colour="red"), "vocabulary 1: there is no key 'colour'; there are category, ids, kind, source, labels"),
        (one(category=None), "vocabulary 1: category: got None, expected text"),
        (one(labels="rim"), "vocabulary 1: labels: got 'rim', expected a list"),
        (one(labels=["rim", "rim"]), "vocabulary 1: labels: 'rim' appears more than once"),
        (one(labels=[True]), "vocabulary 1: labels: label 1: got True, expected text .*quotes"),
        (one(labels=[["rim"]]), "vocabulary 1: labels: label 1: got .*, expected text"),
        (one(ids="14"), "vocabulary 1: ids: got '14', expected a list"),
        (one(ids=[1.5]), "vocabulary 1: ids: got 1.5, expected text"),
        (one(ids=[True]), "vocabulary 1: ids: got True, expected text"),
        ({"vocabularies": [{"category": "mug", "labels": ["rim"]}] * 2}, "vocabularies: several answer to 'mug'"),
    ],
)
def test_what_is_no_vocabulary_is_named_with_its_place(content: object, complaint: str, file: Path) -> None:
    file.write_text(yaml.safe_dump(content))
    with pytest.raises(ConfigError, match=rf"mine\.yaml: {complaint}"):
        read_vocabulary(str(file))


@pytest.mark.parametrize(
    "damage",
    [
        lambda raw: raw[: len(raw) // 2] + b"\n- [",
        lambda raw: raw + b"\xff",
        lambda raw: raw.replace(b"rim", b"r\0m"),
        lambda raw: raw + b"#" * LARGEST_FILE,
    ],
)
def test_a_damaged_file_is_an_error_that_names_it(damage: Callable[[bytes], bytes], file: Path) -> None:
    write_vocabulary(file, VocabularySet("mine", (MUG, BOWL)))
    require_refusal(file, damage(file.read_bytes()))


@pytest.mark.parametrize(
    "raw",
    [
        b"",
        bytes(range(256)),
        b"[" * 10_000,
        b"name: " + b"9" * 10_000,
        b"vocabularies: 2001-99-99",
        b"vocabularies: !!python/object/apply:os.getcwd []",
        b"vocabularies: &a [*a]",
        b"name:\n- &a [lol]\n"
        + b"".join(b"- &%c [%s]\n" % (n + 1, b", ".join([b"*%c" % n] * 9)) for n in range(97, 120)),
    ],
    ids=lambda raw: repr(raw[:30]),
)
def test_what_yaml_makes_of_hostile_files_is_an_error_that_names_them(raw: bytes, file: Path) -> None:
    require_refusal(file, raw)


def require_refusal(file: Path, raw: bytes) -> None:
    file.write_bytes(raw)
    with pytest.raises(ConfigError, match=r"mine\.yaml: ") as caught:
        read_vocabulary(str(file))
    assert len(str(caught.value)) < 2000


def test_a_file_that_is_cut_off_anywhere_is_read_to_a_vocabulary_or_an_error(file: Path) -> None:
    write_vocabulary(file, VocabularySet("mine", (MUG, BOWL)))
    raw, complaints = file.read_bytes(), []
    for end in range(0, len(raw), 3):
        file.write_bytes(raw[:end])
        try:
            assert read_vocabulary(str(file)).vocabularies
        except ConfigError as error:
            complaints.append(str(error))
    assert len(complaints) > len(HEADER) // 3
    assert all(complaint.startswith(str(file)) for complaint in complaints)


def test_the_general_vocabulary_is_what_language_backends_take_when_nobody_says_anything() -> None:
    (general,) = read_vocabulary("general").vocabularies
    assert general.labels == GENERAL_LABELS
