"""The 21 objects of YCB-Video: names, class numbers, symmetries as PoseCNN has them, and where their shapes are."""

from __future__ import annotations

from pathlib import Path

YCB_VIDEO_CLASSES = (  # class number - 1 -> name
    "002_master_chef_can",
    "003_cracker_box",
    "004_sugar_box",
    "005_tomato_soup_can",
    "006_mustard_bottle",
    "007_tuna_fish_can",
    "008_pudding_box",
    "009_gelatin_box",
    "010_potted_meat_can",
    "011_banana",
    "019_pitcher_base",
    "021_bleach_cleanser",
    "024_bowl",
    "025_mug",
    "035_power_drill",
    "036_wood_block",
    "037_scissors",
    "040_large_marker",
    "051_large_clamp",
    "052_extra_large_clamp",
    "061_foam_brick",
)
# Class numbers of PoseCNN and what descends from it (DenseFusion, se(3)-TrackNet, BundleTrack); BOP's list is another.
SYMMETRIC_CLASSES = frozenset({13, 16, 19, 20, 21})
# points.xyz comes first: the published YCB-Video scores are measured on it.
SHAPE_FILES = ("points.xyz", "textured_simple.obj", "textured.obj")  # metres
YCB_VIDEO_FRAME = "YCB-Video's own (PoseCNN release); BOP's YCB-V models differ from it by an offset per object"


def is_symmetric(name: str) -> bool | None:
    """As PoseCNN declares it; None for an object that is not of YCB-Video."""
    if name not in YCB_VIDEO_CLASSES:
        return None
    return YCB_VIDEO_CLASSES.index(name) + 1 in SYMMETRIC_CLASSES


def shape_files(folder: Path, name: str) -> list[Path]:
    """Where the shape of an object may be in a folder of models, in the order of preference."""
    return [folder / name / file for file in SHAPE_FILES]
