"""Shoulders of a head alone, which stand still while it sways."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from ico3d.avatar.render_bundle import baked_gaussians, swaying_head
from ico3d.bundle.format import Bundle, add_files, write_bundle
from ico3d.bundle.head import SHOULDERS
from ico3d.bundle.manifest import Manifest
from ico3d.errors import BundleError
from support.bundles.random_bundle import (
    NUM_POSES,
    random_files,
    random_head,
    random_manifest,
    still_shoulders,
    write_random_bundle,
)


@pytest.fixture
def with_shoulders(tmp_path):
    """A bundle, and how its shoulders stand."""
    path = tmp_path / "a.ico3d"
    write_random_bundle(path, 60)
    still = still_shoulders(random_head(60), NUM_POSES)
    add_files(path, {SHOULDERS: still.to_bytes()})
    return path, still


def test_they_come_back(with_shoulders):
    path, still = with_shoulders
    found = Bundle.open(path).shoulders
    assert found is not None
    np.testing.assert_array_equal(found.share, still.share)
    np.testing.assert_array_equal(found.world_from_shoulders, still.world_from_shoulders)


def test_without_the_file_all_follows_the_head(tmp_path):
    write_random_bundle(tmp_path / "a.ico3d", 60)
    assert Bundle.open(tmp_path / "a.ico3d").shoulders is None


@pytest.mark.parametrize("row", [0.0, 20.5])
def test_shoulders_stand_in_the_world_and_the_head_sways(with_shoulders, row):
    path, still = with_shoulders
    bundle = Bundle.open(path)
    assert bundle.manifest.head is not None
    expression = np.array(bundle.manifest.head.idle_expression, np.float32)
    drawn = swaying_head(bundle, expression, row)
    own = baked_gaussians(bundle.require_head()[0], expression)
    standing = own.transform(still.world_from_shoulders[0].astype(np.float64))
    of_shoulders = torch.from_numpy(still.share == 255)
    of_head = torch.from_numpy(still.share == 0)
    assert of_shoulders.sum() > 5 and of_head.sum() > 5
    np.testing.assert_allclose(drawn.means[of_shoulders], standing.means[of_shoulders], atol=1e-6)
    turns = [
        Rotation.from_quat(g.quats[of_shoulders], scalar_first=True) for g in (drawn, standing)
    ]
    assert (turns[0].inv() * turns[1]).magnitude().max() < 1e-3
    assert bundle.world_from_head is not None
    first = own.transform(bundle.world_from_head[0].astype(np.float64))
    moved = (drawn.means[of_head] - first.means[of_head]).norm(dim=1)
    assert bool((moved < 1e-6).all()) is (row == 0)


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lambda s: replace(s, share=s.share[:-1]), r"head_shoulders\.safetensors: 'share'"),
        (
            lambda s: replace(s, world_from_shoulders=s.world_from_shoulders[:-1]),
            r"head_shoulders\.safetensors: 'world_from_shoulders'",
        ),
    ],
)
def test_what_does_not_fit_the_head_is_refused(with_shoulders, damage, said):
    path, still = with_shoulders
    add_files(path, {SHOULDERS: damage(still).to_bytes()})
    with pytest.raises(BundleError, match=said):
        Bundle.open(path)


def test_a_motion_that_is_not_rigid_is_refused():
    still = still_shoulders(random_head(60), 2)
    still.world_from_shoulders[1, 0, 0] = 2
    with pytest.raises(BundleError, match=r"head_shoulders\.safetensors: pose 1 is not a rigid"):
        still.to_bytes()


def test_a_whole_person_has_none(tmp_path, monkeypatch):
    """The skeleton moves them."""
    monkeypatch.setattr(Manifest, "any_body", property(lambda _: object()))
    monkeypatch.setattr("ico3d.bundle.format.check_manifest", lambda _: None)
    head = random_head(60)
    files = random_files(head) | {"animation.json": b"{}", SHOULDERS: b""}
    with pytest.raises(BundleError, match=r"head_shoulders\.safetensors: does not belong"):
        write_bundle(tmp_path / "a.ico3d", random_manifest(head), files)
