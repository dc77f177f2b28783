"""The scripted scenes do what their names say, whatever the seed; and they are told apart by it."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from eval.scenarios.run import SCENARIOS
from tracker.sources import Sighting
from tracker.sources.synthetic import SyntheticScene, open_scene
from tracker.sources.synthetic.motion import RATE_HZ
from tracker.sources.synthetic.scenes import SCENES
from tracker.sources.synthetic.things.objects import OBJECTS


@cache
def scene(name: str, seed: int) -> SyntheticScene:
    return open_scene(f"{name}?size=160x120&seed={seed}")


@cache
def sightings(name: str, seed: int) -> list[Sighting]:
    (object_id,) = scene(name, seed).object_ids
    return list(scene(name, seed).sightings(object_id))


def out_of_sight(name: str, seed: int) -> list[int]:
    """Frames in which it cannot be seen; they are in one stretch."""
    gone = [s.index for s in sightings(name, seed) if s.visible_fraction < 0.05]
    assert gone == list(range(gone[0], gone[-1] + 1))
    return gone


def turns_deg(name: str, seed: int) -> list[float]:
    """Between each frame and the one before it."""
    return [float(np.degrees(b.T_cam_obj.angle_to_rad(a.T_cam_obj))) for a, b in pairwise(sightings(name, seed))]


@pytest.mark.parametrize("name", SCENARIOS)
def test_the_seed_chooses_object_and_paths_and_the_object_can_be_asked_for(name: str) -> None:
    kind = SCENES[name]
    assert [kind.hero(seed) for seed in range(6)] == list(OBJECTS)
    assert 60 <= kind.frames <= 162
    one, other = (kind.build(seed, "mug") for seed in (1, 2))
    for time_s in (0.0, 0.5):
        assert one.tracked[0].at(time_s).distance_to_m(other.tracked[0].at(time_s)) > 1e-3
    again = kind.build(1, "mug")
    for first, second in zip((*one.tracked, *one.surroundings), (*again.tracked, *again.surroundings), strict=True):
        assert np.array_equal(first.at(1.0).matrix, second.at(1.0).matrix)


@pytest.mark.parametrize("seed", [2])
def test_hidden_is_a_second_out_of_sight_and_all_in_sight_before_and_after(seed: int) -> None:
    gone = out_of_sight("hidden", seed)
    assert RATE_HZ - 2 <= len(gone) <= RATE_HZ + 6
    seen = [s.visible_fraction for s in sightings("hidden", seed)]
    assert min(seen[: gone[0] - 6] + seen[gone[-1] + 7 :]) > 0.95
    assert len(seen) - gone[-1] > 12


@pytest.mark.parametrize("seed", [14])
def test_away_the_object_comes_back_elsewhere_and_turned_beside_its_look_alike(seed: int) -> None:
    gone = out_of_sight("away", seed)
    layout = SCENES["away"].build(seed, SCENES["away"].hero(seed))
    hero, other = layout.tracked[0], layout.surroundings[-1]
    end_s = SCENES["away"].frames / RATE_HZ
    before, after = hero.at(0.0), hero.at(end_s)
    assert before.distance_to_m(after) > 0.02
    assert np.degrees(before.angle_to_rad(after)) >= 40
    assert before.angle_to_rad(hero.at((gone[0] - 5) / RATE_HZ)) < 0.01
    assert other.thing.name == f"{hero.thing.name} look-alike"
    apart_m = other.at(end_s).distance_to_m(after)
    assert 0.03 + 2 * 0.03 < apart_m < 0.3
    assert abs(other.at(gone[0] / RATE_HZ).translation_m[0]) > 0.5  # not there before the object is gone
    assert other.at((gone[-1] - 1) / RATE_HZ).distance_to_m(other.at(end_s)) < 1e-6  # and there before it is back
    assert len(sightings("away", seed)) - gone[-1] > 12


@pytest.mark.parametrize("seed", [2])
def test_gone_for_a_hundred_frames_beside_a_look_alike_half_of_them_in_another_room(seed: int) -> None:
    away = out_of_sight("gone", seed)
    assert len(away) == 100
    assert min(s.visible_fraction for s in sightings("gone", seed) if s.index not in away) > 0.75
    assert turns_deg("gone", seed)[away[-1]] > 35
    layout = SCENES["gone"].build(seed, SCENES["gone"].hero(seed))
    assert callable(layout.T_world_cam)
    cameras = [layout.T_world_cam(k / RATE_HZ) for k in range(SCENES["gone"].frames)]
    jumps = [k for k, (a, b) in enumerate(pairwise(cameras), 1) if a.distance_to_m(b) > 1]
    assert jumps == [away[0] + 50, away[-1] + 1]
    alike = [p.at(0.0) for p in layout.surroundings if p.thing.name == f"{layout.tracked[0].thing.name} look-alike"]
    assert len(alike) == 2
    for camera, other in zip((cameras[0], cameras[away[-1]]), alike, strict=True):
        assert (camera.inverse() @ other).translation_m[2] < 1
    hero = layout.tracked[0].at(0.0)
    assert 0.06 < alike[0].distance_to_m(hero) < 0.4


@pytest.mark.parametrize("seed", [2, 4])
def test_a_hand_leaves_most_of_the_object_in_sight(seed: int) -> None:
    seen = [s.visible_fraction for s in sightings("hand", seed)]
    assert 0.5 < min(seen) < 0.9
    assert min(seen[0], seen[-1]) > 0.95
    assert sum(fraction < 0.9 for fraction in seen) > 15


@pytest.mark.parametrize(("seed", "jumps"), [(0, 1), (1, 1), (2, 2)])
def test_the_camera_jerks_by_fifteen_centimetres_and_forty_degrees(seed: int, jumps: int) -> None:
    camera = SCENES["jerk"].build(seed, "soup_can").T_world_cam
    assert callable(camera)
    poses = [camera(k / RATE_HZ) for k in range(SCENES["jerk"].frames)]
    steps = [(a.distance_to_m(b), np.degrees(a.angle_to_rad(b))) for a, b in pairwise(poses)]
    large = [step for step in steps if step[1] > 3]
    assert len(large) == jumps
    for distance_m, angle_deg in large:
        assert distance_m == pytest.approx(0.15, abs=0.005)
        assert angle_deg == pytest.approx(40, abs=0.6)
    assert max(step[0] for step in steps if step not in large) < 0.01


def test_after_a_jerk_the_object_is_in_sight() -> None:
    assert min(s.visible_fraction for s in sightings("jerk", 1)) > 0.9
    gone = out_of_sight("jerk", 2)
    assert 12 <= len(gone) <= 18
    assert sightings("jerk", 2)[gone[-1] + 1].visible_fraction > 0.9


def test_lights_change_the_colours_and_nothing_else() -> None:
    changed = scene("lights", 1)
    first, last = changed[0], changed[len(changed) - 1]
    mask_first, mask_last = first.masks["tea_box"], last.masks["tea_box"]
    light = [frame.rgb[mask].mean(axis=0) for frame, mask in ((first, mask_first), (last, mask_last))]
    assert np.abs(np.log(light[1] / light[0])).max() > 0.15
    assert np.median(last.depth_m[mask_last]) == pytest.approx(np.median(first.depth_m[mask_first]), abs=0.1)
    assert min(s.visible_fraction for s in sightings("lights", 1)) > 0.95


def test_blind_is_ten_frames_without_depth_in_which_colour_goes_on() -> None:
    failing = scene("blind", 2)
    has_depth = [bool(failing[index].depth_m.any()) for index in range(20, 45)]
    assert has_depth.count(False) == 10
    first = has_depth.index(False)
    assert not any(has_depth[first : first + 10])
    assert failing[20 + first].rgb.std() > 20
    assert failing[20 + first].masks["soup_can"].any()


@pytest.mark.parametrize("seed", [2, 5])
def test_swapped_is_another_object_of_about_its_size_in_its_place_for_good(seed: int) -> None:
    gone = out_of_sight("swapped", seed)
    assert gone[-1] == len(sightings("swapped", seed)) - 1
    assert sightings("swapped", seed)[gone[0] - 1].visible_fraction > 0.95
    layout = SCENES["swapped"].build(seed, SCENES["swapped"].hero(seed))
    hero, other = layout.tracked[0], layout.surroundings[-1]
    assert other.thing.name != hero.thing.name
    assert 0.6 < other.thing.mesh.diameter_m / hero.thing.mesh.diameter_m < 1.6
    before, after = hero.at((gone[0] - 1) / RATE_HZ), other.at(gone[0] / RATE_HZ)
    assert np.hypot(*(before.translation_m - after.translation_m)[:2]) < 0.005
    assert other.at((gone[0] - 1) / RATE_HZ).translation_m[1] > 2  # not to be seen before


@pytest.mark.parametrize("name", ["hidden", "hand", "lights", "blind"])
def test_but_for_what_it_is_about_a_scenario_moves_as_smoothly_as_a_hand(name: str) -> None:
    poses = [s.T_cam_obj for s in sightings(name, 2)]
    assert max(a.distance_to_m(b) for a, b in pairwise(poses)) < 0.01
    assert max(turns_deg(name, 2)) < 2.5
