"""Recorded head poses correct how a fitted skeleton holds its head."""

import numpy as np
import pytest

from ico3d.capture.posing.facing import NECK, facing
from ico3d.rig.binding import Binding
from ico3d.rig.body_track import BodyTrack
from ico3d.rig.quaternions import from_matrix, from_rotvec, to_matrix, to_rotvec
from ico3d.rig.rig import Rig

FRAMES = 9
NAMES = ("root", *NECK, "jaw")
JOINTS = np.array([[0, 1.2, 0], [0, 1.4, 0], [0, 1.43, 0], [0, 1.46, 0.01], [0, 1.5, 0.02]])
RIG = Rig(NAMES, (-1, 0, 1, 2, 3, 4), np.append(JOINTS, [[0, 1.48, 0.06]], 0))
HEAD = RIG.index("head")
OFFSET = np.array([[0.0, 0.1, 1.0, 0.01], [0.0, 1.0, -0.1, 0.08], [1.0, 0.0, 0.0, 0.07]])
"""Where the head's joint has the recording's head: other axes, another origin; made rigid below."""


def _track(turns: np.ndarray) -> BodyTrack:
    """A track whose neck (F, 3) turns by rotation vectors, shared equally by its joints."""
    rotations = np.tile([1.0, 0.0, 0.0, 0.0], (FRAMES, len(NAMES), 1))
    for name in NECK:
        rotations[:, RIG.index(name)] = from_rotvec(turns / len(NECK))
    rotations[:, 0] = from_rotvec(np.array([[0.0, 0.05 * f, 0.0] for f in range(FRAMES)]))
    roots = np.stack([[0.01 * f, 0.0, 0.02 * f] for f in range(FRAMES)])
    surface = (np.zeros((3, 3), np.float32), np.array([[0, 1, 2]], np.int32))
    binding = Binding(np.zeros((3, 4), np.uint8), np.eye(4, dtype=np.float32)[[0, 0, 0]])
    known = np.ones(FRAMES, bool)
    return BodyTrack(RIG, 25.0, rotations, roots, known, *surface, binding, "made up")


def _recorded(track: BodyTrack) -> np.ndarray:
    """(F, 4, 4) head poses of a recording of the person whom a track describes."""
    held = np.eye(4)
    held[:3, :3], held[:3, 3] = to_matrix(from_matrix(_rigid(OFFSET[:, :3]))), OFFSET[:, 3]
    return track.rig.matrices(track.rotations, track.roots)[:, HEAD] @ held


def _rigid(matrix: np.ndarray) -> np.ndarray:
    left, _, right = np.linalg.svd(matrix)
    return left @ np.diag([1, 1, np.linalg.det(left @ right)]) @ right


@pytest.fixture
def turns():
    yaw = np.linspace(-0.6, 0.6, FRAMES)
    return np.stack([0.2 * np.cos(3 * yaw) - 0.11, yaw, 0.1 * yaw], 1)


def test_a_head_that_is_seen_too_near_to_the_front_turns_and_leans_as_recorded(turns):
    true, seen = _track(turns), _track(0.8 * turns)
    found = facing(seen, list(_recorded(true)))
    own, there, before = (
        t.rig.matrices(t.rotations.astype(float), t.roots)[:, HEAD] for t in (found, true, seen)
    )
    relative = np.einsum("fba,fbc->fac", own[:, :3, :3], there[:, :3, :3])
    off = to_rotvec(from_matrix(relative))
    assert np.abs(off - off.mean(0)).max() < 1e-6  # up to one rotation, the mean difference
    places = np.stack([t.joints()[:, HEAD] for t in (found, true, seen)])
    assert np.linalg.norm(before - there, axis=(1, 2)).max() > 0.1
    gaps = np.linalg.norm(places[0] - places[1], axis=1)
    assert gaps.max() < 0.5 * np.linalg.norm(places[2] - places[1], axis=1).max()
    np.testing.assert_allclose(found.rotations[:, [0, 5]], seen.rotations[:, [0, 5]], atol=1e-6)
    np.testing.assert_array_equal(found.roots, seen.roots)


def test_a_head_that_agrees_stays(turns):
    track = _track(turns)
    again = facing(track, list(_recorded(track)))
    np.testing.assert_allclose(again.rotations, track.rotations, atol=1e-6)


def test_frames_without_or_with_an_impossible_pose_stay(turns):
    track = _track(turns)
    poses = list(_recorded(_track(0.9 * turns)))
    wild = np.eye(4)
    wild[:3, :3] = to_matrix(from_rotvec(np.array([0.0, 2.0, 0.0])))
    poses[2], poses[5] = None, poses[5] @ wild
    found = facing(track, poses)
    np.testing.assert_allclose(found.rotations[[2, 5]], track.rotations[[2, 5]], atol=1e-6)
    assert not np.allclose(found.rotations[0], track.rotations[0], atol=1e-3)


def test_a_recording_without_head_poses_changes_nothing(turns):
    track = _track(turns)
    assert facing(track, [None] * FRAMES) is track
