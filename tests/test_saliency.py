"""Which backends there are: ours by name, and those that installed packages bring along."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tracker.errors import ConfigError
from tracker.saliency import BACKENDS, open_backend
from tracker.saliency.combined import Combined

Install = Callable[[str], None]

A_MODULE = """
from tracker.saliency.attributes import Attributes

class Hues(Attributes):
    def __init__(self, device):
        super().__init__()
        self.device = device

def opened(options):
    return Hues(options.device)
"""


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Install:
    """Puts a package beside the installed ones, whose backend "hues" is what the entry point says."""

    def install(entry: str) -> None:
        (tmp_path / "hues_of_a_test.py").write_text(A_MODULE)
        about = tmp_path / "hues_of_a_test-0.1.dist-info"
        about.mkdir()
        (about / "METADATA").write_text("Metadata-Version: 2.1\nName: hues-of-a-test\nVersion: 0.1\n")
        (about / "entry_points.txt").write_text(f"[conceptrack.backends]\nhues = {entry}\n")
        monkeypatch.syspath_prepend(tmp_path)

    return install


def test_a_backend_that_is_not_there_is_answered_with_those_that_are(install: Install) -> None:
    with pytest.raises(ConfigError, match=f"no saliency backend 'telepathy'; expected one of {', '.join(BACKENDS)}$"):
        open_backend("telepathy")
    install("hues_of_a_test:opened")
    with pytest.raises(ConfigError, match=f"expected one of {', '.join(BACKENDS)}, hues$"):
        open_backend("telepathy")


def test_an_installed_package_brings_a_backend_along_alone_and_beside_another(install: Install) -> None:
    install("hues_of_a_test:opened")
    assert type(open_backend("hues")).__name__ == "Hues"
    assert isinstance(open_backend("hues+attributes*0.5"), Combined)


@pytest.mark.parametrize("entry", ["hues_of_a_test:closed", "hues_of_no_test:opened"])
def test_a_package_that_cannot_be_loaded_is_named(install: Install, entry: str) -> None:
    install(entry)
    with pytest.raises(ConfigError, match=f"backend 'hues' cannot be loaded \\({entry}: "):
        open_backend("hues")


def test_what_is_only_the_name_of_code_is_not_run(install: Install) -> None:
    install("hues_of_a_test:opened")
    for name in ("hues_of_a_test:opened", "hues_of_a_test", "os:getcwd"):
        with pytest.raises(ConfigError, match="no saliency backend"):
            open_backend(name)
