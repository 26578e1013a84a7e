"""Where a head is between frames, and the folder of an avatar."""

import json
import shutil

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation, Slerp

from ico3d.avatar.avatar import PLACEMENT, Placement, TrainedAvatar, load_placement, save_placement
from ico3d.body.model_folder import TrainedBody, save_window
from ico3d.body.motion.formulas import Still
from ico3d.body.motion.window_model import WindowModel
from ico3d.body.planning.windows import Window
from ico3d.errors import ModelError
from ico3d.training.checkpoint import load_tensors, save_tensors
from support.avatars.planted_person import ABROAD, NAMES, planted_head

FRAMES = 5


def poses():
    """(5, 4, 4) turns of up to half a circle."""
    rng = np.random.default_rng(0)
    made = np.tile(np.eye(4), (FRAMES, 1, 1))
    made[:, :3, :3] = Rotation.random(FRAMES, rng=rng).as_matrix()
    made[:, :3, 3] = rng.normal(size=(FRAMES, 3))
    return made


@pytest.mark.parametrize("frame", [0.0, 0.25, 1.5, 2.999, 3.0, 3.7, 4.0])
def test_poses_between_frames(frame):
    """Slerp and straight lines."""
    known = poses()
    times = np.arange(FRAMES)
    found = Placement(np.eye(4), known).pose(frame)
    turn = Slerp(times, Rotation.from_matrix(known[:, :3, :3]))(frame).as_matrix()
    np.testing.assert_allclose(found[:3, :3], turn, atol=1e-12)
    place = [np.interp(frame, times, known[:, axis, 3]) for axis in range(3)]
    np.testing.assert_allclose(found[:3, 3], place, atol=1e-12)
    np.testing.assert_allclose(found[3], (0, 0, 0, 1))


def test_the_clip_clamps():
    """Before its begin and after its end the head stays; a clip of one frame is always that."""
    known = poses()
    placement = Placement(ABROAD, known)
    np.testing.assert_array_equal(placement.pose(-3.0), known[0])
    np.testing.assert_array_equal(placement.pose(17.2), known[-1])
    np.testing.assert_allclose(placement.world_from_head(9), known[-1] @ ABROAD)
    single = Placement(np.eye(4), known[:1])
    for frame in (-1.0, 0.0, 0.5, 8.0):
        np.testing.assert_array_equal(single.pose(frame), known[0])


def test_a_pose_is_nobodys_view():
    """Changing what is returned changes nothing else."""
    placement = Placement(np.eye(4), poses())
    placement.pose(1)[:] = 0
    np.testing.assert_array_equal(placement.pose(1), poses()[1])


@pytest.fixture
def avatar(tmp_path):
    """An avatar in a folder: a still body of two windows."""
    generator = torch.Generator().manual_seed(0)
    sizes = {"means": (3,), "quats": (4,), "log_scales": (3,), "opacity_logits": ()}
    sizes |= {"color_logits": (3,)}
    parts = {n: torch.randn(7, *s, generator=generator) for n, s in sizes.items()}
    models = [WindowModel(Still(), dict(parts), {}) for _ in range(2)]
    body = TrainedBody(models, (Window(0, 2), Window(2, 4)), 15.0, "static", {})
    (tmp_path / "body").mkdir()
    for index, model in enumerate(models):
        save_window(tmp_path / "body" / f"{index}.safetensors", model)
    body.save(tmp_path / "body", ["0.safetensors", "1.safetensors"])
    expressions = np.random.default_rng(1).random((FRAMES, len(NAMES))).astype(np.float32)
    made = TrainedAvatar(planted_head(), body, Placement(ABROAD, poses()), expressions, {"x": 1})
    made.save(tmp_path)
    return made, tmp_path


def test_an_avatar_is_what_was_saved(avatar):
    """Bit by bit, at any time, with any expression."""
    made, folder = avatar
    loaded = TrainedAvatar.load(folder)
    assert loaded.summary == {"x": 1}
    assert (loaded.fps, loaded.seconds) == (15.0, 4 / 15)
    for seconds, expression in ((0.0, None), (0.17, None), (9.0, np.full(10, 0.4))):
        one, other = (a.gaussians(seconds, expression) for a in (made, loaded))
        for name in ("means", "quats", "scales", "opacities", "colors"):
            assert torch.equal(getattr(one, name), getattr(other, name))
        assert not one.means.requires_grad
    assert len(one) == 7 + len(made.head.model)
    assert torch.equal(one.means[:7], made.body.gaussians(9.0).means)


def test_expressions_follow_time(avatar):
    """Linear between frames, clamped to the clip; they are what the head shows by default."""
    made, _ = avatar
    known = made.expressions
    np.testing.assert_allclose(made.expression(1.25 / 15), 0.75 * known[1] + 0.25 * known[2])
    np.testing.assert_array_equal(made.expression(-1.0), known[0])
    np.testing.assert_allclose(made.expression(7.0), known[-1], rtol=1e-6)
    with torch.no_grad():
        expected = made.head.model(torch.from_numpy(known[3])).colors
    torch.testing.assert_close(made.head_gaussians(3 / 15).colors, expected)


def test_one_frame(avatar):
    """An avatar that stands still is one, too."""
    made, _ = avatar
    made.body = TrainedBody(made.body.models[:1], (Window(0, 0),), 15.0, "static", {})
    made.placement = Placement(ABROAD, poses()[:1])
    made.expressions = made.expressions[:1]
    assert torch.equal(made.gaussians(0.0).means, made.gaussians(2.0).means)


@pytest.mark.parametrize(
    "damage, sentence",
    [
        (lambda f: (f / "avatar.json").unlink(), "holds no avatar .*make one with ico3d assemble"),
        (lambda f: (f / "avatar.json").write_text("{"), "holds no avatar"),
        (lambda f: (f / "avatar.json").write_text("[]"), "holds no avatar"),
        (lambda f: (f / PLACEMENT).unlink(), "there is no model file"),
        (lambda f: (f / PLACEMENT).write_bytes(b"nothing"), "damaged"),
        (lambda f: shutil.rmtree(f / "head"), "no trained head"),
        (lambda f: shutil.rmtree(f / "body"), "holds no body"),
    ],
)
def test_damaged_folders_are_refused(avatar, damage, sentence):
    """In one sentence."""
    _, folder = avatar
    damage(folder)
    with pytest.raises(ModelError, match=sentence):
        TrainedAvatar.load(folder)


@pytest.mark.parametrize(
    "name, value",
    [
        ("canonical_from_head", np.eye(3)),
        ("canonical_from_head", 1e30 * np.eye(4)),
        ("world_from_canonical", poses()[:, :3]),
        ("world_from_canonical", poses() * np.nan),
        ("expressions", np.zeros(FRAMES, np.float32)),
        ("expressions", np.zeros((), np.float32)),
        ("expressions", np.full((FRAMES, 10), np.inf, np.float32)),
    ],
)
def test_damaged_placements_are_refused(avatar, name, value):
    """Of other shapes, not finite, or out of this world."""
    _, folder = avatar
    tensors, _ = load_tensors(folder / PLACEMENT)
    save_tensors(folder / PLACEMENT, tensors | {name: torch.from_numpy(np.array(value))}, {})
    with pytest.raises(ModelError, match="must be finite and have the shape"):
        load_placement(folder / PLACEMENT)
    save_tensors(folder / PLACEMENT, tensors | {name: tensors[name].bfloat16()}, {})
    with pytest.raises(ModelError, match="Got unsupported ScalarType BFloat16"):
        load_placement(folder / PLACEMENT)
    del tensors[name]
    save_tensors(folder / PLACEMENT, tensors, {})
    with pytest.raises(ModelError, match=f"lacks '{name}'"):
        load_placement(folder / PLACEMENT)


def test_parts_must_belong_together(avatar):
    """As many poses as frames, as many inputs as the head has."""
    made, folder = avatar
    save_placement(folder / PLACEMENT, Placement(ABROAD, poses()[:4]), made.expressions[:4])
    with pytest.raises(ModelError, match="4 head poses for 5 frames"):
        TrainedAvatar.load(folder)
    save_placement(folder / PLACEMENT, made.placement, made.expressions[:, :3])
    with pytest.raises(ModelError, match="3 inputs for 10"):
        TrainedAvatar.load(folder)
    assert json.loads((folder / "avatar.json").read_text())["summary"] == {"x": 1}
