"""The head as the companion of a body's training."""

import pickle
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
import torch

from ico3d.avatar.avatar import PLACEMENT, Placement, save_placement
from ico3d.avatar.joining.companion import JITTER, SEAM, HeadSource
from ico3d.avatar.joining.driving import head_poses
from ico3d.avatar.joining.similarity import moved
from ico3d.common.unpacking import memory
from ico3d.errors import ModelError
from ico3d.training.checkpoint import save_tensors
from support.avatars.planted_person import ABROAD, FRAMES, face

CPU = torch.device("cpu")


@pytest.fixture
def placement(abroad):
    return Placement(ABROAD, head_poses(abroad))


NAN = torch.full((4, 3), torch.nan)


@pytest.fixture
def source(head, abroad, placement, tmp_path):
    """An avatar's folder with all but its body."""
    (tmp_path / "head").mkdir()
    head.save(tmp_path / "head")
    expressions = np.stack([abroad.blendshapes(i) for i in range(FRAMES)])
    save_placement(tmp_path / PLACEMENT, placement, expressions)
    save_tensors(tmp_path / SEAM, {"seam": torch.from_numpy(face()[:17].copy())}, {})
    return HeadSource(tmp_path, 50, True)


def test_the_head_is_where_it_was_recorded(source, abroad):
    """In every frame, with its expression there; it carries no gradient and is made once."""
    companion = source.open(CPU)
    for frame in range(FRAMES):
        drawn = companion.gaussians(frame)
        truth = abroad.head.model(torch.from_numpy(abroad.blendshapes(frame)))
        truth = truth.transform(abroad.true_world_from_head(frame))
        for name in ("means", "quats", "scales", "opacities", "colors"):
            value = getattr(drawn, name)
            assert not value.requires_grad
            if name != "quats":  # q and −q are one rotation
                torch.testing.assert_close(value, getattr(truth, name), rtol=1e-4, atol=1e-5)
        assert companion.gaussians(frame) is drawn


@pytest.mark.parametrize(
    "seam", [{}, {"seam": torch.zeros(3)}, {"seam": torch.zeros(3, 2)}, {"seam": NAN}], ids=str
)
def test_a_file_without_a_seam_is_refused(source, seam):
    save_tensors(source.folder / SEAM, seam, {})
    with pytest.raises(ModelError, match=r"seam\.safetensors holds no positions"):
        source.open(CPU)


def test_a_hash_of_large_files_takes_no_memory(source, monkeypatch):
    """What a folder holds that somebody else began is hashed before it is loaded."""
    before = source.about()
    model = source.folder / "head" / "model.safetensors"
    with model.open("r+b") as hole:
        hole.truncate(64 << 20)
    tracemalloc.start()
    assert source.about() != before
    assert tracemalloc.get_traced_memory()[1] < 8 << 20
    tracemalloc.stop()
    monkeypatch.setattr(memory, "free_memory", lambda: (64 << 20) - 1)
    with pytest.raises(ModelError, match="the free memory is enough for"):
        source.about()


def test_places_are_forbidden_in_the_world(source, placement):
    """At a frame and between two, with the turn, scale and place of the head there."""
    companion = source.open(CPU)
    nose, breast = face()[30], np.array([0.0, -0.3, 0.0])
    for frame in (0, 2.5, 5):
        where = placement.world_from_head(frame)
        places = torch.from_numpy(moved(where, np.stack([nose, breast]))).float()
        assert companion.trespassing(places, frame).tolist() == [True, False]
    free = replace(source, pruning=False).open(CPU)
    assert not free.trespassing(places, frame).any()


def test_border_points_lie_about_the_seam(source, placement):
    """As many as asked for, within the jitter, which grows with the head; the generator decides."""
    companion = source.open(CPU)
    made = companion.border(3, np.random.default_rng(0))
    assert made.shape == (50, 3)
    again = companion.border(3, np.random.default_rng(0))
    np.testing.assert_array_equal(made, again)
    local = moved(np.linalg.inv(placement.world_from_head(3)), made)
    away = np.linalg.norm(local[:, None] - face()[:17], axis=2).min(1)
    assert 0.3 * JITTER < away.mean() < 2 * JITTER
    none = replace(source, border_points=0).open(CPU)
    assert none.border(3, np.random.default_rng(0)).shape == (0, 3)


def test_a_head_without_rim_has_no_border_points(source):
    """Nothing of it lies near the border."""
    save_tensors(source.folder / SEAM, {"seam": torch.zeros(0, 3, dtype=torch.float64)}, {})
    assert source.open(CPU).border(0, np.random.default_rng(0)).shape == (0, 3)


def test_a_source_goes_to_other_processes(source):
    """As its folder and settings."""
    sent = pickle.loads(pickle.dumps(source))
    assert sent == source and sent.about() == source.about()


def test_runs_are_known_by_their_head(source, head, placement):
    """Settings, colours, place, seam and landmarks each make another one."""
    known = [source.about(), replace(source, pruning=False).about()]
    known.append(replace(source, border_points=3).about())
    save_tensors(source.folder / SEAM, {"seam": torch.zeros(3, 3)}, {})
    known.append(source.about())
    head.model.color_branch.bias += 0.1
    head.save(source.folder / "head")
    known.append(source.about())
    replace(head, landmarks=face() + 0.001).save(source.folder / "head")
    known.append(source.about())
    moved_on = Placement(np.eye(4), placement.world_from_canonical)
    save_placement(source.folder / PLACEMENT, moved_on, np.zeros((FRAMES, 10), np.float32))
    known.append(source.about())
    assert all(a != b for i, a in enumerate(known) for b in known[:i])


def test_heads_without_landmarks_are_refused(source, head):
    """Nobody knows where their face is."""
    replace(head, landmarks=None).save(source.folder / "head")
    with pytest.raises(ModelError, match="no landmarks: train it again"):
        source.open(CPU)
