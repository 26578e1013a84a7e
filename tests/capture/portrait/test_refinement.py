"""A portrait whose poses cannot be refined is still a portrait: what was tracked is kept."""

import json
import sys

import numpy as np
import pytest
import torch

from ico3d.capture.face.mediapipe_face import LANDMARKS, MESH_LANDMARKS, CanonicalFace, Face
from ico3d.capture.formats import open_capture
from ico3d.capture.portrait import photometric_poses, readings, track
from ico3d.capture.portrait import settings as portrait_settings
from ico3d.capture.portrait.files import save_picture, save_torso
from ico3d.capture.portrait.parsing import FACE
from ico3d.capture.portrait.rigid_head import Track
from ico3d.capture.portrait.settings import PortraitSettings
from ico3d.capture.portrait.track import track_portrait
from ico3d.errors import SettingsError
from ico3d.splat.device import cuda_fault
from support.pretended_cuda import pretended_cuda

av = pytest.importorskip("av")

WIDTH, HEIGHT, FRAMES = 96, 80, 4
_POINTS = np.random.default_rng(0).normal(0, 0.04, (MESH_LANDMARKS, 3))
_TRACK = Track(
    110.0,
    np.array([WIDTH / 2, HEIGHT / 2]),
    _POINTS,
    np.tile(np.eye(3), (FRAMES, 1, 1)),
    np.tile([0.0, 0.0, -0.6], (FRAMES, 1)),
    np.ones(MESH_LANDMARKS),
)


class Reader:
    """Finds the same face in every picture, as MediaPipe would."""

    names = tuple(f"shape{i}" for i in range(52))

    def __init__(self, model):
        del model

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def read(self, image):
        more = LANDMARKS - MESH_LANDMARKS
        pixels = np.concatenate([_TRACK.project()[0], np.zeros((more, 2))])
        return Face(pixels, np.zeros(52, np.float32), np.eye(4))


def _mattes(work, readings, video=None):
    """All of every picture is a face."""
    ones = np.ones((HEIGHT, WIDTH), np.uint8)
    image = np.repeat(100 * ones[..., None], 3, 2)
    for number in readings.frames:
        save_picture(work / "alpha" / f"{number}.png", 255 * ones)
        save_picture(
            work / "parsing" / f"{number}.png", np.tile(np.uint8(FACE), (HEIGHT, WIDTH, 1))
        )
        (work / "torso_imgs").mkdir(exist_ok=True)
        save_torso(work / "torso_imgs" / f"{number}.png", image, 0 * ones.astype(np.float32))
        save_picture(work / "gt_imgs" / f"{number}.jpg", image)
    save_picture(work / "bc.jpg", image)
    return 1.0, 0.0


@pytest.fixture
def video(tmp_path, monkeypatch):
    """A film, and a machine on which everything but the refinement has been done before."""
    monkeypatch.setattr(track, "model_file", lambda *_: tmp_path)
    monkeypatch.setattr(readings, "FaceReader", Reader)
    face = CanonicalFace(_POINTS, np.zeros((0, 3), int), np.ones(MESH_LANDMARKS))
    monkeypatch.setattr(track, "canonical_face", lambda _: face)
    monkeypatch.setattr(track, "_fitted", lambda *_: _TRACK)
    monkeypatch.setattr(track, "_aligned", lambda *given: given[2])
    monkeypatch.setattr(track, "_save_mattes", _mattes)
    monkeypatch.setattr(track, "_points", lambda *_: _POINTS)
    monkeypatch.setattr(photometric_poses, "COUNT", 200)
    monkeypatch.setattr(portrait_settings, "STEPS", (3, 3))
    path = tmp_path / "me.mp4"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=25)
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        for level in range(FRAMES):
            picture = np.full((HEIGHT, WIDTH, 3), 90 + 9 * level, np.uint8)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        container.mux(stream.encode())
    return path


def _notes(folder) -> list[str]:
    return json.loads((folder / "ico3d.json").read_text())["notes"]


def _is_whole(folder) -> bool:
    capture = open_capture(folder)
    poses = [capture.world_from_head(frame) for frame in range(FRAMES)]
    return all(pose is not None and np.isfinite(pose).all() for pose in poses)


def test_failing_refinement_leaves_the_tracked_capture(video, tmp_path, monkeypatch, capfd):
    def failing(*_, **__):
        raise torch.OutOfMemoryError("CUDA out of memory.\nTried to allocate 20 MiB")

    monkeypatch.setattr(photometric_poses, "render", failing)
    track_portrait(video, tmp_path / "me", PortraitSettings())
    assert _is_whole(tmp_path / "me")
    said = "poses by landmarks only: refining failed (CUDA out of memory.)"
    assert said in _notes(tmp_path / "me")
    assert "refining failed" in " ".join(capfd.readouterr().err.split())


def test_a_gpu_without_gsplat_is_not_the_end(video, tmp_path, monkeypatch):
    cuda_fault.cache_clear()
    with pretended_cuda(monkeypatch):
        monkeypatch.setitem(sys.modules, "gsplat", None)
        track_portrait(video, tmp_path / "me", PortraitSettings())
        with pytest.raises(SettingsError, match="--device cuda does not work here"):
            track_portrait(video, tmp_path / "again", PortraitSettings(device="cuda"))
    cuda_fault.cache_clear()
    assert _is_whole(tmp_path / "me")
    assert not any("refining" in note for note in _notes(tmp_path / "me"))
    assert not (tmp_path / "again").exists()


def test_poses_are_refined_on_cuda(cuda, video, tmp_path):
    track_portrait(video, tmp_path / "me", PortraitSettings(device="cuda"))
    assert _is_whole(tmp_path / "me")
    assert not any("refining" in note for note in _notes(tmp_path / "me"))
