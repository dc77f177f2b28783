"""Settings: defaults in the code, differences in a file, and an unknown or impossible one named with its place."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch
import yaml
from pydantic import BaseModel, ValidationError

from tracker.config import TrackerConfig, dump_config, parse_config, read_config
from tracker.errors import ConfigError

PRESETS = sorted((Path(__file__).resolve().parents[1] / "configs").glob("*.yaml"))
STAGES = {
    name: field.default for name, field in TrackerConfig.model_fields.items() if isinstance(field.default, BaseModel)
}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "settings.yaml"


def test_nobody_needs_a_file(file: Path) -> None:
    file.write_text("")
    assert read_config(None) == read_config(file) == TrackerConfig()


def test_a_file_changes_what_it_names_and_nothing_else(file: Path) -> None:
    file.write_text("prior: off\nview:\n  pixels_across: 48\n")
    config = read_config(file)
    assert (config.prior, config.view.pixels_across) == (False, 48)
    undone = config.model_copy(update={"prior": True, "view": TrackerConfig().view})
    assert undone == TrackerConfig()


def test_what_is_dumped_is_read_as_it_was_and_names_every_setting(file: Path) -> None:
    config = parse_config({"seed": 7, "matching": {"temperature": 0.1}, "filter": {"gate": 0.99}}, "here")
    file.write_text(dump_config(config))
    assert read_config(file) == config
    content = yaml.safe_load(file.read_text())
    assert list(content) == list(TrackerConfig.model_fields)
    for stage, default in STAGES.items():
        assert list(content[stage]) == list(type(default).model_fields)


def test_a_config_cannot_be_changed_in_place() -> None:
    for part in (TrackerConfig(), *STAGES.values()):
        name = next(iter(type(part).model_fields))
        with pytest.raises(ValidationError, match="frozen"):
            setattr(part, name, getattr(part, name))


def test_an_unknown_setting_is_answered_with_the_known_ones(file: Path) -> None:
    file.write_text("temperature: 0.3\n")
    with pytest.raises(
        ConfigError, match=r"settings\.yaml: there is no setting 'temperature'; there are prior, believe"
    ) as caught:
        read_config(file)
    assert all(name in str(caught.value) for name in TrackerConfig.model_fields)


@pytest.mark.parametrize("stage", STAGES)
def test_an_unknown_setting_of_a_stage_is_answered_with_those_of_the_stage(stage: str) -> None:
    with pytest.raises(ConfigError, match=rf"here: there is no setting '{stage}\.colour'; there are ") as caught:
        parse_config({stage: {"colour": 1}}, "here")
    listed = str(caught.value).rpartition("there are ")[2]
    assert listed == ", ".join(type(STAGES[stage]).model_fields)


def test_every_stage_refuses_what_it_does_not_know() -> None:
    assert STAGES
    for part in (TrackerConfig, *(type(default) for default in STAGES.values())):
        assert part.model_config.get("extra") == "forbid"
        assert part.model_config.get("frozen")
        assert part.__doc__


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        ({"believe": 1.5}, r"believe: .*less than or equal to 1 \(got 1\.5\)"),
        ({"believe": "high"}, r"believe: .*valid number.* \(got 'high'\)"),
        ({"view": {"pixels_across": 1}}, r"view\.pixels_across: .*greater than or equal to 8 \(got 1\)"),
        ({"cloud": {"outlier_sigmas": 0}}, r"cloud\.outlier_sigmas: .*greater than 0"),
        ({"matching": {"temperature": 0}}, r"matching\.temperature: .*greater than 0"),
        ({"view": 64}, r"view: .*valid dictionary .*\(got 64\)"),
        (["prior"], "the file: .*valid dictionary"),
        ("prior", "the file: .*valid dictionary"),
    ],
)
def test_a_value_out_of_range_is_named_with_what_came(content: object, complaint: str) -> None:
    with pytest.raises(ConfigError, match=f"here: {complaint}"):
        parse_config(content, "here")


def test_every_complaint_is_told_not_only_the_first() -> None:
    with pytest.raises(ConfigError) as caught:
        parse_config({"believe": 2, "colour": 1, "view": {"size": 3}}, "here")
    assert len(str(caught.value).splitlines()) == 3


def test_what_is_no_yaml_is_named(file: Path) -> None:
    with pytest.raises(ConfigError, match=r"settings\.yaml: cannot be read as YAML"):
        read_config(file)
    for content in (b"prior: [off", b"\xff\xfe\x00", b"view: {pixels_across"):
        file.write_bytes(content)
        with pytest.raises(ConfigError, match=r"settings\.yaml: cannot be read as YAML"):
            read_config(file)


def test_nothing_in_a_file_is_run(file: Path, tmp_path: Path) -> None:
    file.write_text(f"prior: !!python/object/apply:os.mkdir ['{tmp_path / 'made'}']\n")
    with pytest.raises(ConfigError, match="cannot be read as YAML"):
        read_config(file)
    assert not (tmp_path / "made").exists()


@pytest.mark.parametrize("preset", PRESETS, ids=lambda path: path.name)
def test_a_preset_is_read_and_holds_differences_only(preset: Path) -> None:
    config, default = read_config(preset).model_dump(), TrackerConfig().model_dump()
    for name, value in yaml.safe_load(preset.read_text()).items():
        if isinstance(value, dict):
            assert all(config[name][key] != default[name][key] for key in value)
        else:
            assert config[name] != default[name]


def test_the_device_is_found_or_named() -> None:
    assert TrackerConfig().torch_device.type in ("cpu", "cuda")
    assert TrackerConfig(device="cpu").torch_device == torch.device("cpu")
    for absent in ("cuda:99", "abacus"):
        with pytest.raises(ConfigError, match=f"device '{absent}' cannot be used here: "):
            _ = TrackerConfig(device=absent).torch_device


@pytest.mark.parametrize(
    "content",
    ["a: 2001-99-99", "a: !!bool x", "a: !!timestamp x", "[" * 5000, "a: " + "1" * 5000, "? {a}", "#" * 2_000_000],
)
def test_yaml_that_the_parser_stumbles_over_is_named(content: str, tmp_path: Path) -> None:
    (tmp_path / "settings.yaml").write_text(content)
    with pytest.raises(ConfigError, match=r"settings\.yaml: (cannot be read as YAML|larger than such a file can be)"):
        read_config(tmp_path / "settings.yaml")


def test_a_few_lines_that_stand_for_billions_make_a_short_complaint(tmp_path: Path) -> None:
    rows = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    rows += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]" for k in range(1, 10)]
    (tmp_path / "settings.yaml").write_text("\n".join((*rows, "seed: [*a9]")))
    with pytest.raises(ConfigError, match="seed") as caught:
        read_config(tmp_path / "settings.yaml")
    assert len(str(caught.value)) < 5000
