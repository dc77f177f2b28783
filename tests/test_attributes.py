"""Concepts grounded by measuring: what the maps mean, what they keep when the camera or the light changes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tracker.errors import ConfigError
from tracker.frame import Frame, PosedFrame
from tracker.geometry import Intrinsics, Pose
from tracker.saliency import BackendOptions, Query, Saliency, SaliencyBackend, fingerprint_of, open_backend
from tracker.saliency.attributes import COLOUR_TERMS, RELATIVE_TERMS, Attributes, terms_in
from tracker.sources.synthetic import open_scene
from tracker.view import Box, Float32s, ObjectView, ViewConfig, view_object

Picture = npt.NDArray[np.uint8]

AHEAD = Pose(np.eye(3), np.array([0.01, -0.005, 0.35]))
# sRGB of an everyday thing of each colour
PAINTS = {
    "black": (25, 25, 27), "white": (240, 240, 235), "grey": (128, 128, 128), "red": (190, 25, 30),
    "green": (40, 130, 50), "blue": (25, 60, 160), "yellow": (235, 205, 30), "brown": (110, 65, 35),
    "pink": (235, 140, 170), "purple": (110, 50, 135), "orange": (235, 120, 20),
}  # fmt: skip


def panel(**patches: tuple[slice, slice]) -> Picture:
    """(128, 128, 3) in which each paint covers its (rows, columns), later ones over earlier ones."""
    picture = np.zeros((128, 128, 3), np.uint8)
    for paint, place in patches.items():
        picture[place] = PAINTS[paint]
    return picture


def photograph(
    picture: Picture, focal_px: float = 300.0, distance_m: float = 0.5, pixels_across: int = 64
) -> ObjectView:
    """A flat square of 21 cm that faces the camera, with this picture on it, before nothing."""
    height, width = picture.shape[0] + 40, picture.shape[1] + 40
    rgb, depth_m = np.zeros((height, width, 3), np.uint8), np.zeros((height, width), np.float32)
    rgb[20:-20, 20:-20], depth_m[20:-20, 20:-20] = picture, distance_m
    camera = Intrinsics(focal_px, focal_px, (width - 1) / 2, (height - 1) / 2, width, height)
    return seen(Frame(rgb, depth_m, camera, 0), depth_m > 0, 128 / 300 * 0.5, pixels_across)


def folded(view: ObjectView, sign: int, scale: float = 1.0) -> ObjectView:
    """The same picture on a square that is folded along its middle, towards the camera (1) or away from it (-1), all
    of it so many times as large and as far."""
    columns = np.abs(np.arange(view.frame.intrinsics.width) - (view.frame.intrinsics.width - 1) / 2)
    depth_m = np.where(view.mask, scale * (0.5 + sign * columns * 0.5 / 300), 0).astype(np.float32)
    return seen(replace(view.frame, depth_m=depth_m), view.mask, scale * view.extent_m)


def seen(frame: Frame, mask: npt.NDArray[np.bool_], extent_m: float, pixels_across: int = 64) -> ObjectView:
    view = view_object(frame, mask, extent_m, ViewConfig(pixels_across=pixels_across))
    assert view is not None
    return view


def asked(backend: SaliencyBackend, views: Sequence[ObjectView], *labels: str) -> list[Saliency]:
    """The maps of these labels, of the backend's own when there are none."""
    return backend([Query(view, backend.labels_for(labels or None)) for view in views])


def maps_of(view: ObjectView, backend: SaliencyBackend) -> dict[str, Float32s]:
    """Label -> (64, 64) map of a photograph (as many as it has pixels across), without the margin."""
    (saliency,) = asked(backend, [view])
    return {label: whole[4:-4, 4:-4] for label, whole in zip(saliency.labels, saliency.maps, strict=True)}


ALL = (slice(None), slice(None))
MIDDLE = (slice(56, 72), slice(56, 72))
LEFT, RIGHT = (slice(None), slice(0, 64)), (slice(None), slice(64, 128))


def test_maps_have_a_layer_a_label_and_values_from_nothing_to_one(
    globe: Callable[..., PosedFrame], attributes: SaliencyBackend
) -> None:
    balls = [globe(AHEAD), globe(Pose(np.eye(3), np.array([0, 0, 0.25])))]
    views = [seen(ball.frame, ball.mask, 0.1) for ball in balls]
    several = asked(attributes, views)
    for view, saliency in zip(views, several, strict=True):
        assert saliency.labels == attributes.labels_for(None)
        assert saliency.maps.shape == (len(attributes.labels_for(None)), *view.inside.shape)
        assert saliency.maps.dtype == np.float32
        assert saliency.box == view.box
        assert np.isfinite(saliency.maps).all()
        assert saliency.maps.min() >= 0
        assert saliency.maps.max() <= 1
        assert not saliency.maps[:, ~view.inside].any()
        assert np.array_equal(asked(attributes, [view])[0].maps, saliency.maps)


def test_labels_are_distinct_and_the_fingerprint_tells_settings_apart(attributes: SaliencyBackend) -> None:
    assert len(set(attributes.labels_for(None))) == len(attributes.labels_for(None)) == 49
    assert attributes.fingerprint.startswith("attributes-")
    assert fingerprint_of("attributes", "a") == fingerprint_of("attributes", "a")
    assert len({fingerprint_of(*settings) for settings in (("x", "a"), ("x", "b"), ("y", "a"))}) == 3


def test_an_unknown_backend_is_answered_with_those_that_there_are() -> None:
    assert isinstance(open_backend("attributes"), Attributes)


@given(
    seed=st.integers(0, 99), size=st.tuples(st.integers(4, 9), st.integers(4, 9)), block=st.integers(1, 6),
    corner=st.tuples(st.integers(-3, 49), st.integers(-3, 39)),
)  # fmt: skip
def test_single_values_agree_with_the_full_maps(
    seed: int, size: tuple[int, int], block: int, corner: tuple[int, int]
) -> None:
    maps = np.random.default_rng(seed).random((3, *size), np.float32)
    box = Box(corner[0], corner[1], corner[0] + size[1] * block, corner[1] + size[0] * block)
    saliency = Saliency(("a", "b", "c"), maps, box)
    full = saliency.full(40, 50)
    assert full.shape == (3, 40, 50)
    rows, columns = np.indices((40, 50)).reshape(2, -1)
    covered = (columns >= box.x0) & (columns < box.x1) & (rows >= box.y0) & (rows < box.y1)
    values = saliency.sample(columns[covered], rows[covered])
    assert values.shape == (covered.sum(), 3)
    assert np.allclose(values, full[:, rows[covered], columns[covered]].T, atol=1e-5)
    assert not full[:, rows[~covered], columns[~covered]].any()


def test_a_value_at_the_centre_of_a_block_is_that_of_the_map() -> None:
    maps = np.arange(12, dtype=np.float32).reshape(1, 3, 4)
    saliency = Saliency(("a",), maps, Box(10, 20, 10 + 4 * 5, 20 + 3 * 5))
    columns, rows = np.meshgrid(12 + 5 * np.arange(4), 22 + 5 * np.arange(3))
    assert saliency.sample(columns.ravel(), rows.ravel())[:, 0].tolist() == maps.ravel().tolist()
    assert saliency.sample(np.array([14.5]), np.array([22]))[0, 0] == 0.5


@pytest.mark.parametrize("paint", PAINTS)
def test_a_patch_is_called_by_its_colour(paint: str, attributes: SaliencyBackend) -> None:
    ground = "white" if paint != "white" else "black"
    maps = maps_of(photograph(panel(**{ground: ALL, paint: MIDDLE})), attributes)
    named = {term: float(maps[term][30:34, 30:34].mean()) for term in COLOUR_TERMS}
    assert max(named, key=lambda term: named[term]) == paint
    assert float(maps[ground][10, 10]) == max(float(maps[term][10, 10]) for term in COLOUR_TERMS)


def test_the_terms_of_a_scale_share_a_pixel_among_them(attributes: SaliencyBackend) -> None:
    maps = maps_of(photograph(panel(white=ALL, red=LEFT, blue=MIDDLE)), attributes)
    for scale in ("", " nearby", " around"):
        assert np.allclose(sum(maps[term + scale] for term in COLOUR_TERMS), 1, atol=1e-4)


def test_white_beside_red_has_red_nearby_and_white_in_white_has_none(attributes: SaliencyBackend) -> None:
    maps = maps_of(photograph(panel(white=ALL, red=LEFT)), attributes)
    beside, amid = maps["white"][32, 34], maps["white"][32, 60]
    assert abs(beside - amid) < 0.05
    assert maps["red nearby"][32, 34] > maps["red nearby"][32, 60] + 0.1
    assert maps["red around"][32, 38] > maps["red around"][32, 60] + 0.1
    assert maps["red around"][32, 38] > maps["red nearby"][32, 38]


@pytest.mark.parametrize(
    ("paint", "ground", "term", "opposite"),
    [
        ("white", "grey", "lighter", "darker"),
        ("black", "grey", "darker", "lighter"),
        ("red", "grey", "redder", "greener"),
        ("green", "grey", "greener", "redder"),
        ("yellow", "grey", "yellower", "bluer"),
        ("blue", "grey", "bluer", "yellower"),
    ],
)
def test_a_patch_differs_from_its_surroundings_as_one_would_say(
    paint: str, ground: str, term: str, opposite: str, attributes: SaliencyBackend
) -> None:
    maps = maps_of(photograph(panel(**{ground: ALL, paint: MIDDLE})), attributes)
    for scale in (" than nearby", " than around"):
        assert maps[term + scale][32, 32] > 0.3
        assert maps[opposite + scale][32, 32] == 0
        assert maps[term + scale][8, 8] < 0.02
        assert (np.minimum(maps[term + scale], maps[opposite + scale]) == 0).all()


def test_flat_is_flat_and_a_ball_is_curved_and_a_box_has_an_edge(
    globe: Callable[..., PosedFrame], attributes: SaliencyBackend
) -> None:
    flat = maps_of(photograph(panel(white=ALL)), attributes)
    assert flat["flat"][10:-10, 10:-10].min() > 0.45
    assert max(flat[term][10:-10, 10:-10].max() for term in ("curved", "convex edge", "rim")) < 0.05
    ball = globe(AHEAD)
    view = seen(ball.frame, ball.mask, 0.1)
    (saliency,) = asked(attributes, [view])
    round_off = dict(zip(saliency.labels, saliency.maps, strict=True))
    centre = (slice(20, 32), slice(20, 32))
    assert round_off["curved"][centre].mean() > 2 * flat["curved"][20:32, 20:32].mean() + 0.02
    assert round_off["flat"][centre].mean() < flat["flat"][20:32, 20:32].mean() - 0.02


@pytest.mark.parametrize(("sign", "term", "other"), [(1, "convex edge", "rim"), (-1, "rim", "convex edge")])
def test_a_fold_towards_the_camera_is_an_edge_and_one_away_from_it_a_rim(
    sign: int, term: str, other: str, attributes: SaliencyBackend
) -> None:
    maps = maps_of(folded(photograph(panel(grey=ALL)), sign), attributes)
    assert maps[term][20:44, 30:34].mean() > 0.2
    assert maps[term][20:44, 30:34].mean() > 2 * maps[other][20:44, 30:34].mean()
    assert maps[term][20:44, 30:34].mean() > maps[term][20:44, 10:14].mean() + 0.15


@pytest.mark.parametrize(("focal_px", "distance_m"), [(600.0, 0.5), (300.0, 0.25)])
def test_twice_the_resolution_or_half_the_distance_gives_the_same_maps(
    focal_px: float, distance_m: float, attributes: SaliencyBackend
) -> None:
    picture = panel(white=ALL, red=LEFT, blue=MIDDLE, yellow=(slice(90, 120), slice(20, 100)))
    one = maps_of(photograph(picture), attributes)
    twice = maps_of(photograph(picture.repeat(2, axis=0).repeat(2, axis=1), focal_px, distance_m), attributes)
    for label, concept_map in one.items():
        assert np.abs(twice[label] - concept_map).mean() < 0.002, label


@pytest.mark.parametrize("sign", [1, -1])
def test_a_thing_twice_as_large_and_twice_as_far_gives_the_same_maps(sign: int, attributes: SaliencyBackend) -> None:
    view = photograph(panel(white=ALL, red=LEFT))
    one, two = (maps_of(folded(view, sign, scale), attributes) for scale in (1.0, 2.0))
    for label, concept_map in one.items():
        assert np.abs(two[label] - concept_map).max() < 0.01, label


def test_a_coarser_view_gives_the_same_maps_but_for_their_finest_detail(attributes: SaliencyBackend) -> None:
    picture = panel(white=ALL, red=LEFT, blue=(slice(32, 96), slice(32, 96)))
    fine, coarse = (maps_of(photograph(picture, pixels_across=pixels), attributes) for pixels in (64, 32))
    for terms, kind, bound in ((COLOUR_TERMS, "", 0.006), (RELATIVE_TERMS, " than", 0.02)):
        labels = [term + kind + scale for term in terms for scale in (" nearby", " around")]
        halved = np.stack([fine[label].reshape(32, 2, 32, 2).mean(axis=(1, 3)) for label in labels])
        assert np.abs(np.stack([coarse[label] for label in labels]) - halved).mean() < bound, kind


def test_where_there_is_no_depth_nothing_is_said_of_the_surface(attributes: SaliencyBackend) -> None:
    view = photograph(panel(white=ALL))
    depth_m = view.frame.depth_m.copy()
    depth_m[20 + 40 : 20 + 60, 20 + 40 : 20 + 60] = 0
    maps = maps_of(seen(replace(view.frame, depth_m=depth_m), view.mask, view.extent_m), attributes)
    hole = (slice(20, 30), slice(20, 30))
    assert maps["white"][hole].min() > 0.5
    assert max(maps[term][hole].max() for term in ("flat", "curved", "convex edge", "rim")) == 0
    assert maps["flat"][40, 40] > 0.45


def test_a_rendered_object_has_the_same_concepts_at_twice_the_resolution(attributes: SaliencyBackend) -> None:
    values = []
    for size in ("320x240", "640x480"):
        scene = open_scene(f"turn?size={size}&noise=0&frames=9&object=cereal_box")
        T_cam_obj, points_obj = scene.sightings("cereal_box")[8].T_cam_obj, scene.shape("cereal_box").points_m
        view = seen(scene[8], scene[8].masks["cereal_box"], 0.29)
        points_cam = T_cam_obj @ points_obj
        columns, rows = scene.intrinsics.project(points_cam).T
        nearest = np.rint(np.stack((rows, columns))).astype(int)
        depth_m = scene[8].depth_m[tuple(nearest)]
        visible = scene[8].masks["cereal_box"][tuple(nearest)] & (np.abs(depth_m - points_cam[:, 2]) < 0.003)
        values.append(np.where(visible[:, None], asked(attributes, [view])[0].sample(columns, rows), np.nan))
    both = np.isfinite(values[0] + values[1]).all(axis=1)
    assert both.sum() > 500
    coarse, fine = values[0][both], values[1][both]
    assert np.abs(coarse - fine).mean() < 0.2 * coarse.std(axis=0).mean()
    assert np.corrcoef(coarse.ravel(), fine.ravel())[0, 1] > 0.97


@pytest.mark.parametrize("gains", [(0.85, 0.85, 0.85), (1.08, 1.0, 0.9)])
def test_a_change_of_exposure_or_white_balance_leaves_the_relative_terms_nearly_alone(
    gains: tuple[float, float, float], attributes: SaliencyBackend
) -> None:
    picture = panel(white=ALL, red=LEFT, grey=(slice(0, 40), slice(40, 90)), blue=MIDDLE)
    other = np.clip(picture * np.array(gains), 0, 255).round().astype(np.uint8)
    before, after = (maps_of(photograph(shown), attributes) for shown in (picture, other))
    relative = [label for label in before if " than " in label]
    one, two = (np.stack([maps[label] for label in relative]) for maps in (before, after))
    assert np.corrcoef(one.ravel(), two.ravel())[0, 1] > 0.98
    assert np.abs(one - two).mean() < 0.15 * one.mean()
    lit = np.abs(before["white"] - after["white"])[:, 40:]
    assert lit.mean() > 3 * np.abs(one - two).mean()


def test_what_is_beside_the_object_does_not_show_in_its_maps(attributes: SaliencyBackend) -> None:
    view = photograph(panel(white=ALL, red=LEFT))
    rgb = np.where(view.mask[:, :, None], view.frame.rgb, np.uint8(200))
    depth_m = np.where(view.mask, view.frame.depth_m, np.float32(0.55))
    among = seen(replace(view.frame, rgb=rgb, depth_m=depth_m), view.mask, view.extent_m)
    assert np.array_equal(asked(attributes, [among])[0].maps, asked(attributes, [view])[0].maps)


def test_a_phrase_is_where_all_its_measurable_terms_are(attributes: SaliencyBackend) -> None:
    """Left half red, right half blue; the red handle is red, the handle alone means nothing to a colorimeter."""
    view = photograph(panel(blue=ALL, red=LEFT))
    phrase, red, blue = asked(attributes, [view], "red handle", "red", "dark BLUE  flat spout")[0].maps
    assert np.array_equal(phrase, red)
    assert red[4:-4, 8:32].mean() > 0.5 > 0.1 > red[4:-4, 40:64].mean()
    assert blue[4:-4, 40:64].mean() > 4 * blue[4:-4, 8:32].mean()


@pytest.mark.parametrize(
    ("label", "terms"),
    [
        ("red nearby", ("red nearby",)),
        ("red or nearby", ("red",)),
        ("the convex edge of a grey lid", ("convex edge", "grey")),
        ("reddish", ()),
        ("blue and blue", ("blue",)),
    ],
)
def test_the_longest_terms_of_a_phrase_count(label: str, terms: tuple[str, ...]) -> None:
    assert terms_in(label) == terms


@pytest.mark.parametrize(
    ("labels", "words"),
    [
        (("red", "spout"), ("cannot measure 'spout'", "convex edge")),
        (("red", "Red"), ("'Red'", "twice")),
        (("red", " "), ("' '",)),
        ((), ("empty",)),
    ],
)
def test_a_vocabulary_that_cannot_be_measured_is_refused(
    labels: tuple[str, ...], words: tuple[str, ...], attributes: SaliencyBackend
) -> None:
    with pytest.raises(ConfigError) as refusal:
        attributes.labels_for(labels)
    assert all(word in str(refusal.value) for word in words)


def test_there_are_no_weights_to_load() -> None:
    with pytest.raises(ConfigError, match="no weights"):
        open_backend("attributes", BackendOptions(weights="large"))


def test_an_object_that_is_said_to_be_nearly_at_the_lens_takes_no_more_memory_than_another(
    can_frames: list[Frame], attributes: SaliencyBackend
) -> None:
    frame = replace(can_frames[0], depth_m=np.full_like(can_frames[0].depth_m, 1e-6))
    view = view_object(frame, frame.masks["soup_can"], 0.1, ViewConfig())
    assert view is not None
    assert view.pixels_across > 1e6
    (saliency,) = attributes([Query(view, attributes.labels_for(None))])
    assert np.isfinite(saliency.maps).all()
