"""What a measurement ran on is told with it."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path

import pytest

from eval.environment import environment, processor


def test_the_environment_is_told_by_versions() -> None:
    told = environment()
    assert told["python"].startswith("3.")
    assert told["numpy"] == version("numpy")
    assert {"machine", "torch", "scipy", "open3d", "small_gicp", "filterpy"} <= set(told)


@pytest.mark.parametrize(
    ("cpuinfo", "name"),
    [
        ("processor\t: 0\nmodel name\t: AMD EPYC 9\nflags\t: fpu\n", "AMD EPYC 9"),
        ("Serial\t: 7\n", "riscv64"),
        (None, "riscv64"),
    ],
)
def test_the_processor_is_told_by_its_name_where_the_system_has_one(
    cpuinfo: str | None, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if cpuinfo is not None:
        (tmp_path / "cpuinfo").write_text(cpuinfo)
    monkeypatch.setattr("eval.environment.CPUINFO", tmp_path / "cpuinfo")
    monkeypatch.setattr("platform.processor", lambda: "")
    monkeypatch.setattr("platform.machine", lambda: "riscv64")
    monkeypatch.setattr("os.sched_getaffinity", lambda _: {0, 2, 5}, raising=False)
    monkeypatch.setattr("os.cpu_count", lambda: 3)
    assert processor() == f"{name}, 3 cores"
