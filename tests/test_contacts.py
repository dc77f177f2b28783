"""Candidate poses in which a point of the cloud touches one of the model that is like it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch

from tracker.appearance import ViewAppearance
from tracker.cloud import PointCloud
from tracker.concept import ConceptModel
from tracker.contacts import ContactConfig, Contacts
from tracker.geometry import Pose
from tracker.glance import Glance
from tracker.matching import Matcher, MatchingConfig
from tracker.registration import RegistrationConfig
from tracker.verification import VerificationConfig, Verifier, evenly
from tracker.view import ObjectView, ViewConfig

CONFIG, ALIKE, CPU = ContactConfig(), RegistrationConfig(), torch.device("cpu")


def contacts(model: ConceptModel, config: ContactConfig = CONFIG) -> Contacts:
    judged = VerificationConfig()
    glance = Glance(model, Verifier(model, judged, ViewConfig().pixels_across).surface, judged, CPU)
    return Contacts(model, config, ALIKE, Matcher(model, MatchingConfig(), CPU), glance)


def near(poses: list[Pose], truth: Pose) -> list[int]:
    """Which of them a refinement would bring to the truth."""
    return [
        k for k, pose in enumerate(poses) if pose.angle_to_rad(truth) < 0.35 and pose.distance_to_m(truth) < 0.02
    ]  # fmt: skip


def test_of_an_object_in_full_view_the_first_is_right(
    can_model: ConceptModel, can_view: ObjectView, can_cloud: PointCloud, can_truth: Pose
) -> None:
    for masked in (True, False):
        poses = contacts(can_model)(can_cloud, can_view, ViewAppearance(can_view), masked=masked)
        assert near(poses, can_truth)[0] < 3


def test_where_concepts_say_nothing_right_the_picture_does(
    can_model: ConceptModel, can_view: ObjectView, can_cloud: PointCloud, can_truth: Pose
) -> None:
    """Every point of the cloud says what another one should."""
    shuffled = np.random.default_rng(0).permutation(len(can_cloud))
    cloud = replace(can_cloud, saliency=can_cloud.saliency[shuffled])
    anywhere = ContactConfig(likely=CONFIG.places)
    found = near(contacts(can_model, anywhere)(cloud, can_view, ViewAppearance(can_view), masked=True), can_truth)
    assert found
    assert found[0] < 5


def test_in_every_pose_a_point_of_the_cloud_touches_the_model_face_to_face(
    can_model: ConceptModel, can_view: ObjectView, can_cloud: PointCloud
) -> None:
    config = ContactConfig(points=4, likely=5, turns=6)
    poses = contacts(can_model, config)(can_cloud, can_view, ViewAppearance(can_view), masked=True)
    touching = evenly(can_cloud.points, config.points)
    assert poses
    for pose in poses:
        points, normals = pose @ can_model.points, can_model.normals @ pose.rotation.T
        apart_m = np.linalg.norm(points[:, None] - can_cloud.points[touching], axis=2)
        across = normals @ can_cloud.normals[touching].T
        assert ((apart_m < 1e-5) & (across > 1 - 1e-5)).any()


def test_poses_are_distinct_and_not_more_than_candidates_of_registration(
    can_model: ConceptModel, can_view: ObjectView, can_cloud: PointCloud
) -> None:
    poses = contacts(can_model)(can_cloud, can_view, ViewAppearance(can_view), masked=True)
    assert 1 < len(poses) <= ALIKE.candidates
    centre_m = can_model.points.mean(axis=0)[None]
    for k, pose in enumerate(poses):
        for other in poses[:k]:
            apart_m = float(np.linalg.norm(pose @ centre_m - other @ centre_m))
            turned = pose.angle_to_rad(other) > ALIKE.distinct_rad - 1e-3
            assert turned or apart_m > ALIKE.distinct_share * can_model.diameter_m - 1e-5


def test_it_can_be_left_out(can_model: ConceptModel, can_view: ObjectView, can_cloud: PointCloud) -> None:
    left_out = contacts(can_model, ContactConfig(points=0))
    assert left_out(can_cloud, can_view, ViewAppearance(can_view), masked=True) == []


def test_the_same_is_found_the_same(can_model: ConceptModel, can_view: ObjectView, can_cloud: PointCloud) -> None:
    one, two = (contacts(can_model)(can_cloud, can_view, ViewAppearance(can_view), masked=True) for _ in range(2))
    assert all(np.array_equal(a.matrix, b.matrix) for a, b in zip(one, two, strict=True))
