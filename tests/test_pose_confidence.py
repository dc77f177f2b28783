"""The confidence of a pose: what speaks for it makes it likelier, and nobody minds a turn that cannot be seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tracker.confidence import MEASURES, WEIGHTS, Grounds, confidence, turn_sigma_rad
from tracker.geometry import Pose
from tracker.refinement import Refined
from tracker.symmetry import NO_SYMMETRY, Symmetry
from tracker.verification import NOTHING_SEEN

FAIR = Grounds(replace(NOTHING_SEEN, colour=0.6, contradicted=0.1, explained=0.7), turn_sigma_rad=0.02, turn_rad=0.05)
ROUND = Symmetry.generated([], np.zeros(3), np.array((0.0, 0.0, 1.0)))


def with_evidence(**shares: float) -> Grounds:
    return replace(FAIR, evidence=replace(FAIR.evidence, **shares))


def test_a_measure_has_a_weight_and_a_name() -> None:
    assert FAIR.measures().shape == WEIGHTS.shape == (len(MEASURES),)
    assert confidence(FAIR) == pytest.approx(1 / (1 + np.exp(-FAIR.measures() @ WEIGHTS)))


@pytest.mark.parametrize("share", ["colour", "contradicted", "explained"])
def test_more_that_agrees_makes_it_likelier(share: str) -> None:
    shares = np.linspace(0, 1, 11)
    stated = [
        confidence(with_evidence(**{share: value})) for value in (1 - shares if share == "contradicted" else shares)
    ]
    assert stated == sorted(stated)
    assert stated[-1] > stated[0] + 0.1
    assert min(stated) >= 0
    assert max(stated) <= 1


def test_a_rotation_that_nothing_holds_makes_it_less_likely() -> None:
    stated = [confidence(replace(FAIR, turn_sigma_rad=sigma)) for sigma in (1e-6, 0.003, 0.02, 0.1, 1.0, np.inf)]
    assert stated == sorted(stated, reverse=True)
    assert stated[0] > 0.9
    assert stated[-1] < 0.01


def test_a_surprising_turn_makes_it_less_likely() -> None:
    stated = [confidence(replace(FAIR, turn_rad=turn)) for turn in (0.0, 0.05, 0.3, 3.0)]
    assert stated == sorted(stated, reverse=True)
    assert stated[0] > stated[-1]


def test_the_turn_about_the_axis_of_a_round_thing_is_nobody_s() -> None:
    tilted = Pose.exp(np.array((0.4, -0.3, 0.2, 0.0, 0.0, 0.5)))
    axis_cam = tilted.rotation @ (0, 0, 1)
    firm = np.diag([0.01**-2] * 3 + [0.001**-2] * 3)
    loose = firm.copy()  # knows nothing of the turn about the axis
    loose[:3, :3] -= np.outer(axis_cam, axis_cam) * 0.01**-2
    refined = [Refined(tilted, information, np.zeros((0, 6)), 0.0, 100) for information in (firm, loose)]
    assert turn_sigma_rad(refined[0], NO_SYMMETRY) == pytest.approx(0.01 * np.sqrt(3), rel=1e-3)
    assert turn_sigma_rad(refined[1], NO_SYMMETRY) > 100
    for each in refined:
        assert turn_sigma_rad(each, ROUND) == pytest.approx(0.01 * np.sqrt(2), rel=1e-3)
