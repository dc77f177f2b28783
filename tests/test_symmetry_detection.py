"""What is the same after a turn is found, what differs in shape or paint is not, what was not seen is not claimed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from reference.onboard import onboard, read_reference_frames
from reference.symmetry_detection import detect_symmetry
from tracker.concept import ConceptModel
from tracker.declared_symmetry import parse_symmetry
from tracker.geometry import Floats, Pose
from tracker.saliency import SaliencyBackend
from tracker.sources.synthetic import open_scene
from tracker.symmetry import NO_SYMMETRY, angles_rad

T_OBJ_BODY = Pose.exp([0.3, -0.8, 0.5, 0.1, 0.02, -0.3])  # where the body's own axes are, in object coordinates
ALL = tuple((axis, sign) for axis in range(3) for sign in (1, -1))
ALL_BUT_THE_BOTTOM = tuple(side for side in ALL if side != (2, -1))
Paint = Callable[[Floats, Floats], Floats]


def plain(points: Floats, _: Floats) -> Floats:
    return np.full_like(points, 160)


def lit(points: Floats, normals: Floats) -> Floats:
    """The same gray everywhere, lit from one side."""
    return np.full_like(points, 90) + 70 * np.maximum(normals @ [0.6, 0.3, 0.74], 0)[:, None]


def logo(points: Floats, normals: Floats) -> Floats:
    """A dark stripe along an edge of the front."""
    on_it = (normals[:, 0] > 0.9) & (points[:, 1] > 0.01)
    return np.where(on_it[:, None], (40, 40, 90), (160, 160, 160)).astype(float)


def model_of(points: Floats, normals: Floats, colours: Floats, seed: int = 0) -> ConceptModel:
    """Noise of a five hundredth of the size, normals that waver, grainy colours; in the coordinates of an object."""
    rng = np.random.default_rng(seed)
    diameter_m = float(np.linalg.norm(np.ptp(points, axis=0)))
    wavering = normals + rng.normal(0, 0.1, normals.shape)
    many = len(points)
    return ConceptModel(
        object_id="body",
        points=T_OBJ_BODY @ (points + rng.normal(0, 0.002 * diameter_m, points.shape)),
        normals=wavering / np.linalg.norm(wavering, axis=1, keepdims=True) @ T_OBJ_BODY.rotation.T,
        colours=np.clip(colours + rng.normal(0, 4, colours.shape), 0, 255).astype(np.float32),
        saliency=np.ones((many, 1), np.float32),
        view_count=np.ones(many, np.int32),
        agreement=np.ones(many, np.float32),
        view_directions=np.eye(3),
        diameter_m=diameter_m,
        labels=("gray",),
        backend="attributes",
        fingerprint="attributes-0",
    )


def box(
    size_m: tuple[float, float, float], paint: Paint = plain, sides: tuple[tuple[int, int], ...] = ALL
) -> ConceptModel:
    rng, size = np.random.default_rng(1), np.array(size_m)
    points, normals = [], []
    for axis, sign in sides:
        area = np.delete(size, axis).prod() / (size.prod() / size).sum() / 2
        face, normal = (rng.random((int(3000 * area), 3)) - 0.5) * size, np.zeros(3)
        face[:, axis], normal[axis] = sign * size[axis] / 2, sign
        points.append(face)
        normals.append(np.broadcast_to(normal, face.shape))
    stacked = np.concatenate(points), np.concatenate(normals)
    return model_of(*stacked, paint(*stacked))


def cylinder(seen_rad: float, paint: Paint = plain) -> ConceptModel:
    """The wall and the two ends of a tin, as far as that angle about its axis."""
    rng = np.random.default_rng(2)
    angle, height = rng.random(3000) * seen_rad, rng.random(3000) - 0.5
    end, radius = rng.integers(0, 3, 3000) - 1, np.sqrt(rng.random(3000))  # -1 and 1: the ends, 0: the wall
    round_about = np.stack((np.cos(angle), np.sin(angle), np.zeros(3000)), axis=1)
    up = np.array([0.0, 0.0, 1.0])
    wall = round_about * 0.035 + up * height[:, None] * 0.1
    ends = round_about * 0.035 * radius[:, None] + up * end[:, None] * 0.05
    points = np.where((end == 0)[:, None], wall, ends)
    normals = np.where((end == 0)[:, None], round_about, up * end[:, None])
    return model_of(points, normals, paint(points, normals))


CUBE, PILLAR, BRICK = (0.1, 0.1, 0.1), (0.1, 0.1, 0.2), (0.1, 0.14, 0.2)


@pytest.mark.parametrize("paint", [plain, lit])
@pytest.mark.parametrize(
    ("size_m", "sides", "turns"),
    [
        (CUBE, ALL, "x:90,y:90"),
        (PILLAR, ALL, "z:90,x:180"),
        (BRICK, ALL, "x:180,y:180"),
        (BRICK, ALL_BUT_THE_BOTTOM, "z:180"),  # who has not seen its bottom does not know its height
    ],
)
def test_a_plain_box_has_the_turns_of_its_sides_about_its_middle(
    size_m: tuple[float, float, float], sides: tuple[tuple[int, int], ...], turns: str, paint: Paint
) -> None:
    found, expected = detect_symmetry(box(size_m, paint, sides)), parse_symmetry(turns).turns
    assert found.axis is None
    assert len(found.turns) == len(expected)
    for turn in expected:
        in_object = T_OBJ_BODY.rotation @ turn @ T_OBJ_BODY.rotation.T
        assert angles_rad(found.turns, in_object).min() < np.radians(1)
    off_m = T_OBJ_BODY.rotation.T @ (found.origin_m - T_OBJ_BODY.translation_m)
    assert np.linalg.norm(off_m if sides == ALL else off_m[:2]) < 0.0015


def test_a_side_that_was_not_seen_and_a_stripe_that_was_are_no_symmetry() -> None:
    size_m = (0.1, 0.14, 0.2)
    assert detect_symmetry(box(size_m, sides=((0, 1), (1, 1), (2, 1)))) is NO_SYMMETRY
    assert detect_symmetry(box(size_m, logo)) is NO_SYMMETRY


def test_a_plain_tin_may_be_turned_by_any_angle_and_set_upside_down() -> None:
    for paint in (plain, lit):
        found = detect_symmetry(cylinder(2 * np.pi, paint))
        assert found.axis is not None
        assert abs(found.axis @ T_OBJ_BODY.rotation[:, 2]) > np.cos(np.radians(1))
        assert np.linalg.norm(found.origin_m - T_OBJ_BODY.translation_m) < 0.0015
        assert len(found.turns) == 2


def test_a_tin_with_a_stripe_or_seen_from_one_side_only_may_not() -> None:
    assert detect_symmetry(cylinder(2 * np.pi, logo)) is NO_SYMMETRY
    assert detect_symmetry(cylinder(np.pi * 0.6)) is NO_SYMMETRY


def test_stripes_that_come_again_after_half_a_turn_are_not_taken_for_a_symmetry_of_a_round_thing() -> None:
    def twice(_: Floats, normals: Floats) -> Floats:
        return np.where((np.abs(normals[:, :1]) > 0.8), (40, 40, 90), (160, 160, 160)).astype(float)

    found = detect_symmetry(cylinder(2 * np.pi, twice))
    assert found is NO_SYMMETRY


@pytest.mark.parametrize("scene", ["turn", "tabletop"])
def test_of_the_rendered_things_only_the_bowl_is_symmetric(scene: str, attributes: SaliencyBackend) -> None:
    for name in ("bowl", "soup_can", "mug", "cereal_box", "tea_box", "clamp"):
        source = open_scene(f"{scene}?size=320x240" + (f"&object={name}" if scene == "turn" else ""))
        found = onboard(read_reference_frames(source, name, 2), attributes).symmetry
        if name == "bowl":
            assert found.axis is not None
            assert abs(found.axis[2]) > np.cos(np.radians(1))
            assert np.linalg.norm(found.origin_m[:2]) < 0.0015
            assert len(found.turns) == 1
        else:
            assert found is NO_SYMMETRY, name


def test_of_a_bowl_of_which_too_little_was_seen_nothing_is_claimed(attributes: SaliencyBackend) -> None:
    source = open_scene("shelf?size=320x240")
    assert onboard(read_reference_frames(source, "bowl", 2), attributes).symmetry is NO_SYMMETRY


def test_what_is_declared_is_taken(attributes: SaliencyBackend) -> None:
    frames = read_reference_frames(open_scene("turn?size=320x240&object=bowl"), "bowl", 2)
    for declared in (NO_SYMMETRY, parse_symmetry("z:inf")):
        assert onboard(frames, attributes, symmetry=declared).symmetry is declared
