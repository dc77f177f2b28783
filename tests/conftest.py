"""What tests share: rendered scenes, the models made of them, and how hypothesis behaves."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import settings

from reference.onboard import onboard, read_reference_frames
from tests.drawn_bop import draw_bop
from tracker.cloud import CloudConfig, PointCloud, lift
from tracker.concept import ConceptModel
from tracker.frame import Frame, PosedFrame, Provenance
from tracker.geometry import Floats, Intrinsics, Pose
from tracker.saliency import Query, SaliencyBackend, open_backend
from tracker.sources.synthetic import SyntheticScene, open_scene
from tracker.view import ObjectView, ViewConfig, view_object

SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"

# The same examples at every run, and no example fails because the machine was busy.
settings.register_profile("conceptrack", deadline=None, derandomize=True)
settings.load_profile("conceptrack")

# A shell that starts tests in the background has ctrl-C ignored, and tests that press it would wait for ever.
signal.signal(signal.SIGINT, signal.default_int_handler)

# Small tensors gain nothing from more threads, and on a busy machine threads wait for each other.
torch.set_num_threads(1)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The recordings that are not part of the project; tests that use them carry the marker `shared_data`."""
    if not SHARED_DATA.is_dir():
        pytest.skip(f"the shared recordings are not at {SHARED_DATA}")
    return SHARED_DATA


@pytest.fixture
def program(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Callable[..., tuple[int, str]]:
    """A program's `main` in this process with these arguments: its exit code and what it says, on one line."""

    def call(main: Callable[[], None], *arguments: object) -> tuple[int, str]:
        monkeypatch.setattr(sys, "argv", ["program", *map(str, arguments)])
        try:
            main()
            code = 0
        except SystemExit as ending:
            code = int(ending.code or 0)
        return code, " ".join(str(capsys.readouterr().err).split())

    return call


@pytest.fixture(scope="session")
def attributes() -> SaliencyBackend:
    """The backend that needs no weights."""
    return open_backend("attributes")


@pytest.fixture(scope="session")
def can_scene() -> SyntheticScene:
    """A soup can turns and travels before a camera that is still: 90 frames, rendered when they are asked for."""
    return open_scene("turn?size=320x240&object=soup_can")


@pytest.fixture(scope="session")
def can_model(can_scene: SyntheticScene, attributes: SaliencyBackend) -> ConceptModel:
    """Of three frames of `can_scene`, from its middle and its two ends, whatever onboarding would choose."""
    sightings = can_scene.sightings("soup_can")
    frames = [(can_scene[k], sightings[k].T_cam_obj) for k in (53, 5, 86)]
    return onboard([PosedFrame(frame, "soup_can", pose, frame.masks["soup_can"]) for frame, pose in frames], attributes)


@pytest.fixture(scope="session")
def can_file(can_model: ConceptModel, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """`can_model`, saved."""
    path = tmp_path_factory.mktemp("models") / "can.concept"
    can_model.save(path)
    return path


@pytest.fixture(scope="session")
def can_frames(can_scene: SyntheticScene) -> list[Frame]:
    """Frames 20 to 31 of `can_scene`, none of which `can_model` was made of."""
    return [can_scene[index] for index in range(20, 32)]


@pytest.fixture(scope="session")
def can_truth(can_scene: SyntheticScene) -> Pose:
    """T_cam_obj in frame 20 of `can_scene`."""
    return can_scene.sightings("soup_can")[20].T_cam_obj


@pytest.fixture(scope="session")
def can_view(can_frames: list[Frame], can_model: ConceptModel) -> ObjectView:
    """What frame 20 of `can_scene` shows of the can."""
    view = view_object(can_frames[0], can_frames[0].masks["soup_can"], can_model.diameter_m, ViewConfig())
    assert view is not None
    return view


@pytest.fixture(scope="session")
def can_cloud(can_view: ObjectView, attributes: SaliencyBackend) -> PointCloud:
    return lift(can_view, attributes([Query(can_view, attributes.labels_for(None))])[0], CloudConfig())


@pytest.fixture(scope="session")
def table_scene() -> SyntheticScene:
    """Six objects and clutter on a table, the camera goes around: 90 frames."""
    return open_scene("tabletop?size=320x240")


@pytest.fixture(scope="session")
def table_models(table_scene: SyntheticScene, attributes: SaliencyBackend) -> dict[str, ConceptModel]:
    """Of the mug and the tea box of `table_scene`, two reference frames each."""
    chosen = ("mug", "tea_box")
    return {name: onboard(read_reference_frames(table_scene, name, 2), attributes) for name in chosen}


@pytest.fixture(scope="session")
def globe() -> Callable[..., PosedFrame]:
    """Draws a ball of ten centimetres before a gray wall, in colours that are a function of the place on it."""
    return draw_globe


GLOBE_RADIUS_M = 0.05
GLOBE_CAMERA = Intrinsics(300.0, 300.0, 159.5, 119.5, 320, 240)


def draw_globe(
    T_cam_obj: Pose,
    camera: Intrinsics = GLOBE_CAMERA,
    wall_m: float = 0.8,
    index: int = 0,
    paint: Callable[[Floats], Floats] | None = None,
) -> PosedFrame:
    """paint: unit vectors (N, 3) of the object frame -> colours (N, 3) in [0, 255]; if None smooth, nowhere alike."""
    rows, columns = np.indices((camera.height, camera.width)).reshape(2, -1)
    rays = camera.unproject(columns, rows, np.ones(len(rows)))
    centre, squared = T_cam_obj.translation_m, (rays**2).sum(axis=1)
    along = rays @ centre
    under_root = along**2 - squared * (centre @ centre - GLOBE_RADIUS_M**2)
    mask = under_root > 0
    depth_m = np.where(mask, (along - np.sqrt(np.maximum(under_root, 0))) / squared, wall_m)
    rgb = np.full((len(rows), 3), 128.0)
    outwards = T_cam_obj.inverse() @ (rays[mask] * depth_m[mask, None]) / GLOBE_RADIUS_M
    rgb[mask] = (paint or _wavy)(outwards)
    size = (camera.height, camera.width)
    frame = Frame(
        rgb=rgb.reshape(*size, 3).round().astype(np.uint8),
        depth_m=depth_m.reshape(size).astype(np.float32),
        intrinsics=camera,
        stamp_ns=index * 33_333_333,
        masks={"globe": mask.reshape(size)},
        index=index,
        provenance=Provenance(f"globe {index}", "drawn"),
    )
    return PosedFrame(frame, "globe", T_cam_obj, frame.masks["globe"])


def _wavy(outwards: Floats) -> Floats:
    x, y, z = outwards.T
    return 128 + 120 * np.sin(np.stack((4 * x + z, 3 * y + 2 * x, 5 * z + y), axis=1))


@pytest.fixture
def bop_dataset(tmp_path: Path) -> Path:
    """What `draw_bop` draws."""
    draw_bop(tmp_path / "bop")
    return tmp_path / "bop"
