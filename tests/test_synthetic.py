"""The rendered world: what is drawn, what is said of it, and what the sensor makes of it agree."""

from __future__ import annotations

from functools import cache
from itertools import combinations, pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
import open3d as o3d
import pytest
import trimesh
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from tracker.errors import SourceError
from tracker.frame import Frame
from tracker.geometry import Intrinsics, Pose
from tracker.sources import PosedSource, open_source
from tracker.sources.synthetic import SyntheticScene, open_scene
from tracker.sources.synthetic.motion import around
from tracker.sources.synthetic.rendering.picture import pixel_rays
from tracker.sources.synthetic.rendering.world import Placed, World
from tracker.sources.synthetic.scenes import SCENES
from tracker.sources.synthetic.sensor import exposure
from tracker.sources.synthetic.things.mesh import Mesh, joined, surface_samples
from tracker.sources.synthetic.things.objects import OBJECTS, shape_of, tracked_object
from tracker.sources.synthetic.things.solids import BOX_SIDES, box

SMALL = "size=160x120"


@cache
def scene(argument: str) -> SyntheticScene:
    return open_scene(argument)


@cache
def frame(argument: str, index: int) -> Frame:
    return scene(argument)[index]


def same_picture(one: Frame, other: Frame) -> bool:
    return np.array_equal(one.rgb, other.rgb) and np.array_equal(one.depth_m, other.depth_m)


def test_a_frame_does_not_depend_on_what_was_read_before_it() -> None:
    first, second = (open_scene(f"turn?{SMALL}") for _ in range(2))
    forwards = {index: first[index] for index in (3, 4, 40)}
    for index in (40, 3, 4, 4):
        assert same_picture(forwards[index], second[index])
        for object_id, mask in forwards[index].masks.items():
            assert np.array_equal(mask, second[index].masks[object_id])


def test_iterating_gives_the_frames_by_index_with_rising_stamps() -> None:
    short = open_scene(f"still?{SMALL}&frames=4")
    frames = list(short)
    assert [f.index for f in frames] == [0, 1, 2, 3] == list(range(len(short)))
    assert [f.stamp_ns for f in frames] == [round(i * 1e9 / 30) for i in range(4)]
    assert all(same_picture(f, short[f.index]) for f in frames)
    assert frames[0].provenance.clock == "synthetic"
    for outside in (-1, 4):
        with pytest.raises(IndexError, match="frames 0 to 3"):
            short[outside]


def test_the_number_of_frames_does_not_change_a_frame() -> None:
    assert same_picture(frame(f"still?{SMALL}", 2), open_scene(f"still?{SMALL}&frames=3")[2])


def test_another_seed_gives_another_picture_and_other_poses() -> None:
    one, other = f"still?{SMALL}&noise=0", f"still?{SMALL}&noise=0&seed=1"
    assert not np.array_equal(frame(one, 0).rgb, frame(other, 0).rgb)
    a, b = (scene(name).sightings("tea_box")[0].T_cam_obj for name in (one, other))
    assert a.distance_to_m(b) > 1e-4


def test_noise_differs_between_frames_of_a_scene_in_which_nothing_moves() -> None:
    noisy, clean = f"still?{SMALL}", f"still?{SMALL}&noise=0"
    assert not same_picture(frame(noisy, 0), frame(noisy, 1))
    assert same_picture(frame(clean, 0), frame(clean, 1))


def test_open_source_answers_a_posed_source_that_knows_its_name() -> None:
    source = open_source(f"synthetic:still?{SMALL}")
    assert isinstance(source, PosedSource)
    assert source.name == f"synthetic:still?{SMALL}"
    with pytest.raises(SourceError, match="tea_box"):
        source.sightings("spoon")


@pytest.mark.parametrize("name", [f"tabletop?{SMALL}&noise=0", f"shelf?{SMALL}&noise=0", f"turn?{SMALL}&noise=0"])
def test_clean_depth_under_a_mask_lies_on_the_object_at_its_pose(name: str) -> None:
    source = scene(name)
    for index in (7, 60):
        picture = frame(name, index)
        for object_id in source.object_ids:
            T_cam_obj = source.sightings(object_id)[index].T_cam_obj
            rows, columns = np.nonzero(picture.masks[object_id])
            assert len(rows) > 40, f"{object_id} is hardly seen"
            points_cam = picture.intrinsics.unproject(
                columns.astype(float), rows.astype(float), picture.depth_m[rows, columns].astype(float)
            )
            samples = KDTree(source.shape(object_id).points_m)
            distances_m, _ = samples.query(T_cam_obj.inverse() @ points_cam)
            spacing_m = samples.query(source.shape(object_id).points_m, k=2)[0][:, 1].max()
            assert distances_m.max() < 2 * spacing_m, object_id
            assert np.median(distances_m) < 0.003, object_id


def test_noisy_depth_errs_by_millimetres_and_has_holes() -> None:
    clean, noisy = frame(f"tabletop?{SMALL}&noise=0", 7), frame(f"tabletop?{SMALL}", 7)
    seen = (noisy.depth_m > 0) & (clean.depth_m < 1.2)
    assert 0.7 < (noisy.depth_m > 0).mean() < 0.99
    errors_m = np.abs(noisy.depth_m - clean.depth_m)[seen]
    assert 0.0003 < np.median(errors_m) < 0.003
    assert noisy.depth_m.max() <= 3.5
    assert (clean.depth_m > 0).all()


def test_noise_grows_with_its_setting() -> None:
    clean = frame(f"still?{SMALL}&noise=0", 5)
    spreads: list[float] = []
    for level in ("0.5", "1", "2"):
        noisy = frame(f"still?{SMALL}&noise={level}", 5)
        seen = (noisy.depth_m > 0) & (clean.depth_m < 1.2)
        spreads.append(float(np.median(np.abs(noisy.depth_m - clean.depth_m)[seen])))
    assert spreads[0] < spreads[1] < spreads[2]


@pytest.mark.parametrize("index", [0, 45, 89])
def test_masks_are_disjoint_and_every_object_has_one(index: int) -> None:
    masks = frame(f"tabletop?{SMALL}", index).masks
    assert set(masks) == set(OBJECTS)
    for one, other in combinations(masks.values(), 2):
        assert not (one & other).any()


@pytest.mark.parametrize("name", ["tabletop?size=320x240&noise=0", f"leave?{SMALL}&noise=0"])
def test_sightings_count_the_pixels_of_the_masks(name: str) -> None:
    source = scene(name)
    for object_id in source.object_ids:
        sightings = source.sightings(object_id)
        assert [s.index for s in sightings] == list(range(len(source)))
        for index in (0, 36, 45, 62, 89):
            counted = int(frame(name, index).masks[object_id].sum())
            assert sightings[index].visible_px == pytest.approx(counted, rel=0.1, abs=4), (object_id, index)
            assert (sightings[index].visible_px == 0) == (counted == 0)
            assert (sightings[index].visible_fraction > 0) == (counted > 0)


def test_clutter_hides_parts_of_some_objects_of_the_tabletop() -> None:
    source = scene("tabletop?size=320x240&noise=0")
    least = {o: min(s.visible_fraction for s in source.sightings(o)) for o in source.object_ids}
    most = {o: max(s.visible_fraction for s in source.sightings(o)) for o in source.object_ids}
    assert sum(fraction < 0.6 for fraction in least.values()) >= 2
    assert min(least.values()) > 0.1
    assert min(most.values()) > 0.85


def test_the_object_is_hidden_then_out_of_view_then_back() -> None:
    source = scene(f"leave?{SMALL}&noise=0")
    (object_id,) = source.object_ids
    sightings = source.sightings(object_id)
    pixels = [s.visible_px for s in sightings]
    gone = [index for index, count in enumerate(pixels) if count == 0]
    phases = [list(run) for run in np.split(gone, np.flatnonzero(np.diff(gone) > 1) + 1)]
    assert len(phases) == 2
    assert all(len(phase) >= 8 for phase in phases)
    inside = [_in_view(source.intrinsics, sightings[phase[len(phase) // 2]].T_cam_obj) for phase in phases]
    assert inside == [True, False]
    for index in (phases[0][2], phases[1][2]):
        assert not frame(source.name.removeprefix("synthetic:"), index).masks[object_id].any()
    assert min(pixels[0], pixels[75], pixels[-1]) > 100


def _in_view(camera: Intrinsics, T_cam_obj: Pose) -> bool:
    ((x, y),) = camera.project(T_cam_obj.translation_m[None])
    return bool(0 <= x < camera.width and 0 <= y < camera.height)


@pytest.mark.parametrize(
    ("name", "step_m", "step_deg"),
    [("tabletop", 0.010, 2), ("turn", 0.010, 2.5), ("shelf", 0.010, 2), ("still", 0, 0), ("leave", 0.04, 3)],
)
def test_poses_move_as_smoothly_as_a_hand(name: str, step_m: float, step_deg: float) -> None:
    source = scene(f"{name}?{SMALL}&noise=0")
    for object_id in source.object_ids:
        poses = [s.T_cam_obj for s in source.sightings(object_id)]
        assert max(a.distance_to_m(b) for a, b in pairwise(poses)) <= step_m
        assert np.degrees(max(a.angle_to_rad(b) for a, b in pairwise(poses))) <= step_deg


def test_the_tabletop_camera_goes_around_by_a_hundred_degrees() -> None:
    sightings = scene(f"tabletop?{SMALL}&noise=0").sightings("bowl")
    assert 90 < np.degrees(sightings[0].T_cam_obj.angle_to_rad(sightings[-1].T_cam_obj)) < 110
    assert all(0.45 < s.T_cam_obj.translation_m[2] < 0.95 for s in sightings)


def test_exposure_and_white_balance_wander_but_not_far() -> None:
    gains = np.stack([exposure(0, index, 1.0) for index in range(150)])
    assert 0.05 < np.ptp(gains.mean(axis=1)) < 0.4
    assert np.ptp(gains[:, 0] / gains[:, 2]) > 0.01
    assert (exposure(0, 99, 0.0) == 1).all()
    brightness = [frame(f"still?{SMALL}", index).rgb.mean() for index in (0, 20, 36, 37, 59)]
    assert np.ptp(brightness) > 2


@pytest.mark.parametrize(
    ("argument", "expected"),
    [
        ("kitchen", r"tabletop \(.*turn \(.*shelf \(.*still \(.*leave \("),
        ("", "no scene"),
        ("tabletop?colour=red", "frames, seed, size, noise, object"),
        ("tabletop?frames=0", "whole number from 1"),
        ("tabletop?frames=many", "whole number"),
        ("tabletop?seed=-1", "whole number from 0"),
        ("tabletop?size=320", "WIDTHxHEIGHT"),
        ("tabletop?size=5x5", "from 64"),
        ("tabletop?noise=nan", "number from 0"),
        ("tabletop?noise=-2", "number from 0"),
        ("turn?object=spoon", "cereal_box, tea_box, soup_can, mug, clamp, bowl"),
        ("tabletop?object=mug", "has all objects"),
        ("tabletop?frames=3&frames=4", "twice"),
        ("tabletop?frames", "whole number"),
    ],
)
def test_what_is_not_known_is_refused_with_what_there_is(argument: str, expected: str) -> None:
    with pytest.raises(SourceError, match=expected):
        open_source(f"synthetic:{argument or '?'}")


def test_options_choose_size_and_object() -> None:
    source = open_scene("still?frames=2&size=200x100&object=clamp")
    assert source.object_ids == ("clamp",)
    assert source[0].rgb.shape == (100, 200, 3)
    assert len(source) == 2


@pytest.mark.parametrize("object_id", OBJECTS)
def test_meshes_are_closed_centred_and_turned_outwards(object_id: str) -> None:
    mesh = tracked_object(object_id).mesh
    for body in range(int(mesh.body.max()) + 1):
        solid = trimesh.Trimesh(mesh.vertices_m, mesh.faces[mesh.body == body], process=False)
        solid.merge_vertices(merge_tex=True, merge_norm=True)
        assert solid.is_watertight
        assert solid.is_winding_consistent
        assert solid.volume > 0
    assert np.abs(mesh.vertices_m.max(0) + mesh.vertices_m.min(0)).max() < 1e-9
    assert 0.05 < np.ptp(mesh.vertices_m, axis=0).max() < 0.25
    assert mesh.uv.min() >= 0
    assert mesh.uv.max() <= 1


@pytest.mark.parametrize("object_id", OBJECTS)
def test_shapes_are_samples_of_the_surface(object_id: str) -> None:
    shape, mesh = shape_of(object_id), tracked_object(object_id).mesh
    assert _distances_m(mesh, shape.points_m).max() < 1e-5
    assert 2000 <= len(shape.points_m) <= 5000
    spread_m = np.linalg.norm(shape.points_m[:, None, :] - shape.points_m[None, ::7, :], axis=-1).max()
    assert 0.95 * shape.diameter_m < spread_m <= shape.diameter_m + 1e-9
    assert shape.symmetric == (object_id == "bowl")


@pytest.mark.parametrize("object_id", OBJECTS)
def test_only_the_bowl_looks_the_same_from_all_around(object_id: str) -> None:
    front = _albedo(object_id, 0)
    for azimuth_deg in (23, 90, 137, 180, 291):
        other = _albedo(object_id, azimuth_deg)
        both = (front.sum(-1) > 0) & (other.sum(-1) > 0)
        change = np.abs(front - other)[both].mean()
        either = (front.sum(-1) > 0) | (other.sum(-1) > 0)
        if object_id == "bowl":
            assert change < 2
            assert both.sum() > 0.97 * either.sum()
        else:
            assert change > 8 or both.sum() < 0.7 * either.sum()


def test_the_bowl_turned_by_any_angle_lies_on_itself() -> None:
    bowl = tracked_object("bowl").mesh
    for angle in np.linspace(0.1, 6.2, 9):
        turned = shape_of("bowl").points_m @ Rotation.from_euler("z", angle).as_matrix().T
        assert _distances_m(bowl, turned).max() < 2e-4


def _albedo(object_id: str, azimuth_deg: float) -> npt.NDArray[np.float64]:
    """(80, 80, 3) colours without light, 0 beside the object, seen from somewhat above."""
    thing = tracked_object(object_id)
    camera = Intrinsics(80, 80, 39.5, 39.5, 80, 80)
    T_world_cam = around([0, 0, 0], azimuth_deg, 25, 1.2 * thing.mesh.diameter_m)
    columns, rows = np.meshgrid(np.arange(80), np.arange(80))
    world = World([Placed(thing, Pose.identity())])
    hits = world.trace(*pixel_rays(T_world_cam, camera, columns.ravel(), rows.ravel()), 0.0)
    colours = world.atlas.lookup(hits.uv, np.ones(len(hits.uv)))[:, :3].astype(float)
    colours[hits.owner < 0] = 0
    return colours.reshape(80, 80, 3)


def _raycasting(vertices_m: npt.NDArray[np.floating], faces: npt.NDArray[np.integer]) -> Any:
    surface: Any = o3d.t.geometry.RaycastingScene()
    surface.add_triangles(vertices_m.astype(np.float32), faces.astype(np.uint32))
    return surface


def _distances_m(mesh: Mesh, points_m: npt.NDArray[np.floating]) -> npt.NDArray[np.floating]:
    return _raycasting(mesh.vertices_m, mesh.faces).compute_distance(points_m.astype(np.float32)).numpy()


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("seed", [0, 1])
def test_nothing_stands_inside_something_else(name: str, seed: int) -> None:
    layout = SCENES[name].build(seed, SCENES[name].hero(seed))
    time_s = 1.0
    placed = [(p.thing.name, p.thing.mesh.moved(p.at(time_s))) for p in (*layout.tracked, *layout.surroundings)]
    for object_id in (p.thing.name for p in layout.tracked):
        T_world_obj = next(p for p in layout.tracked if p.thing.name == object_id).at(time_s)
        inner = T_world_obj @ (0.97 * shape_of(object_id).points_m[::4])  # what touches does not count
        for other, mesh in placed:
            if other not in (object_id, "room") and not (mesh.vertices_m.max(0) < inner.min(0)).any():
                assert not _inside(mesh, inner).any(), f"{object_id} in {other}"


def _inside(mesh: Mesh, points_m: npt.NDArray[np.floating]) -> npt.NDArray[np.bool_]:
    inside = np.zeros(len(points_m), bool)
    for body in range(int(mesh.body.max()) + 1):
        faces = mesh.faces[mesh.body == body]
        corners = mesh.vertices_m[faces].reshape(-1, 3)
        near = ((points_m > corners.min(0)) & (points_m < corners.max(0))).all(axis=1)
        if near.any():
            occupied = _raycasting(mesh.vertices_m, faces).compute_occupancy(points_m[near].astype(np.float32)).numpy()
            inside[np.flatnonzero(near)[occupied > 0.5]] = True
    return inside


def test_points_buried_in_another_body_are_no_surface_samples() -> None:
    cube = box((0.1, 0.1, 0.1), dict.fromkeys(BOX_SIDES, (0.0, 0.0, 1.0, 1.0)))
    shifted = cube.moved(Pose(np.eye(3), np.array([0.05, 0.0, 0.03])))
    samples = surface_samples(joined([cube, shifted], separate=True), 3000)
    in_first = (np.abs(samples) < 0.0499).all(axis=1)
    in_second = (np.abs(samples - [0.05, 0.0, 0.03]) < 0.0499).all(axis=1)
    assert not (in_first | in_second).any()
    assert len(samples) > 2000
