"""The frames of a recording from which the most can be learnt about an object."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from reference.keyframes import LEAST_VISIBLE_PX, choose_reference_frames
from reference.viewsphere import farthest_point_sampling, icosphere_directions, view_direction
from tracker.errors import OnboardingError
from tracker.geometry import Floats, Pose
from tracker.sources import Sighting


def sighting(
    index: int, azimuth_deg: float = 0, elevation_deg: float = 0, visible_px: int = 1000, fraction: float = 1.0,
    distance_m: float = 0.6, roll_deg: float = 0,
) -> Sighting:  # fmt: skip
    """Of an object that lies in the middle of the picture, seen from this direction of its own frame."""
    R_obj_cam = Rotation.from_euler("ZYX", (azimuth_deg, -elevation_deg, 0), degrees=True).as_matrix()
    R_obj_cam = R_obj_cam @ np.array([[0.0, 0, -1], [-1, 0, 0], [0, 1, 0]])  # the camera's z looks along -x
    R_obj_cam = R_obj_cam @ Rotation.from_euler("z", roll_deg, degrees=True).as_matrix()
    return Sighting(index, Pose(R_obj_cam.T, np.array([0, 0, distance_m])), visible_px, fraction)


def indices(sightings: list[Sighting], count: int) -> list[int]:
    return [s.index for s in choose_reference_frames(sightings, count)]


def all_around(seed: int, count: int = 40) -> list[Sighting]:
    rng = np.random.default_rng(seed)
    return [
        sighting(i, rng.uniform(0, 360), rng.uniform(-80, 80), int(rng.integers(500, 3000)), rng.uniform(0.7, 1))
        for i in range(count)
    ]


@given(azimuth_deg=st.floats(-180, 180), elevation_deg=st.floats(-90, 90), roll_deg=st.floats(-180, 180),
       distance_m=st.floats(0.1, 5))  # fmt: skip
def test_the_direction_of_a_view_is_towards_the_camera_however_far_and_however_held(
    azimuth_deg: float, elevation_deg: float, roll_deg: float, distance_m: float
) -> None:
    a, e = np.radians((azimuth_deg, elevation_deg))
    towards = view_direction(
        sighting(0, azimuth_deg, elevation_deg, distance_m=distance_m, roll_deg=roll_deg).T_cam_obj
    )
    assert towards == pytest.approx([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], abs=1e-9)


def test_the_direction_turns_with_the_object_s_axes() -> None:
    seen, G = sighting(0, 30, 40), Pose.exp([0.3, -0.5, 1.0, 0, 0, 0])
    turned = Sighting(0, seen.T_cam_obj @ G.inverse(), 1000, 1.0)
    assert np.allclose(view_direction(turned.T_cam_obj), G.rotation @ view_direction(seen.T_cam_obj))


def test_the_best_visible_frame_comes_first_and_the_opposite_view_second() -> None:
    views = [sighting(i, azimuth_deg=45 * i, visible_px=1000 + (i == 3)) for i in range(8)]
    assert indices(views, 1) == [3]
    assert indices(views, 2) == [3, 7]
    assert set(indices(views, 4)) == {1, 3, 5, 7}
    assert sorted(indices(views, 99)) == list(range(8))


def least_angle_deg(directions: Floats) -> float:
    angles = np.degrees(np.arccos(np.clip(directions @ directions.T, -1, 1)))
    return float(angles[np.triu_indices(len(angles), 1)].min(initial=180))


@given(seed=st.integers(0, 1000), count=st.integers(2, 6))
def test_chosen_views_are_as_wide_as_sampling_from_any_start_and_do_not_depend_on_the_order_of_asking(
    seed: int, count: int
) -> None:
    views = [replace(view, visible_fraction=1.0) for view in all_around(seed)]
    chosen = choose_reference_frames(views, count)
    assert len(chosen) == count
    assert indices(views[::-1], count) == [s.index for s in chosen]
    directions = np.stack([view_direction(s.T_cam_obj) for s in views])
    widest = max(least_angle_deg(directions[farthest_point_sampling(directions, count, k)]) for k in range(len(views)))
    assert (
        least_angle_deg(np.stack([view_direction(s.T_cam_obj) for s in chosen])) > widest - 11
    )  # snapped and compared roughly


def test_a_camera_that_passes_by_gives_its_two_ends_wherever_the_object_is_seen_best() -> None:
    views = [sighting(i, azimuth_deg=5 * i, visible_px=1000 + 100 * (i == 8)) for i in range(17)]
    assert sorted(indices(views, 2)) == [0, 16]


def test_a_half_hidden_view_is_taken_where_it_lies_more_than_twice_as_far() -> None:
    views = [sighting(0), sighting(1, azimuth_deg=20), sighting(2, azimuth_deg=60, fraction=0.5)]
    assert sorted(indices(views, 2)) == [0, 2]
    views[1] = sighting(1, azimuth_deg=55)
    assert sorted(indices(views, 2)) == [0, 1]


def test_of_frames_from_one_direction_the_best_visible_and_then_the_earliest_is_taken() -> None:
    node = icosphere_directions(3)[100]
    azimuth_deg, elevation_deg = np.degrees((np.arctan2(node[1], node[0]), np.arcsin(node[2])))
    near = [(9, 900), (4, 1400), (2, 1400), (7, 1399)]
    same_side = [sighting(i, azimuth_deg + 0.1 * i, elevation_deg, px) for i, px in near]
    other_side = sighting(5, azimuth_deg + 180, -elevation_deg, visible_px=5000)
    assert indices([*same_side, other_side], 5) == [5, 2]


def test_a_still_camera_gives_one_frame_however_many_are_wanted() -> None:
    assert indices([sighting(i, roll_deg=3 * i, distance_m=0.5 + i / 100) for i in range(30)], 5) == [0]


def test_frames_in_which_the_object_is_hidden_or_tiny_teach_nothing() -> None:
    front, back = sighting(0), sighting(1, azimuth_deg=180)
    hidden = sighting(1, azimuth_deg=180, fraction=0.25)
    tiny = sighting(1, azimuth_deg=180, visible_px=LEAST_VISIBLE_PX - 1)
    assert indices([front, back], 2) == [0, 1]
    assert indices([front, hidden], 2) == [0]
    assert indices([front, tiny], 2) == [0]


def test_an_object_that_is_always_half_hidden_is_learnt_from_its_best_frames() -> None:
    views = [sighting(0, fraction=0.5), sighting(1, azimuth_deg=180, fraction=0.35), sighting(2, 90, fraction=0.1)]
    assert indices(views, 3) == [0, 1]


def test_a_recording_that_never_shows_the_object_is_refused_with_what_it_shows() -> None:
    with pytest.raises(
        OnboardingError, match=f"none of 2 frames .* at most 399 pixels .* {LEAST_VISIBLE_PX} are needed"
    ):
        choose_reference_frames([sighting(0, visible_px=399), sighting(1, visible_px=12)], 2)
    with pytest.raises(OnboardingError, match="none of 0 frames"):
        choose_reference_frames([], 2)
