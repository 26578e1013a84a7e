"""From a head and a capture of the body, in studios that differ in everything, to an avatar."""

import json
from dataclasses import replace

import numpy as np
import pytest
import torch
from PIL import Image

from ico3d import cli
from ico3d.avatar.avatar import TrainedAvatar
from ico3d.avatar.joining import assemble as module
from ico3d.avatar.joining.assemble import align, assemble, measured
from ico3d.avatar.joining.checking import write_checks
from ico3d.avatar.joining.companion import HeadSource
from ico3d.avatar.joining.settings import JoiningSettings
from ico3d.avatar.joining.similarity import moved
from ico3d.body.companion import Pruning
from ico3d.body.training.optimise_window import BodyTrainer
from ico3d.capture.capture import Capture
from ico3d.errors import CaptureError, SettingsError
from ico3d.measure.body import evaluate_body
from support.avatars.planted_person import ABROAD, FRAMES, PlantedPerson, face, planted_head
from support.avatars.tiny_joining import STEPS_PER_FRAME, assembly_of

pytestmark = pytest.mark.slow


class Stopped(Exception):
    """Somebody has ended the process."""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Capture, folder and what was said; assembled in two goes, as the first is interrupted."""
    folder = tmp_path_factory.mktemp("made")
    capture, said = PlantedPerson.elsewhere(folder / "capture"), []
    (folder / "head").mkdir()
    planted_head().save(folder / "head")
    assembly = assembly_of(folder / "head")
    step = BodyTrainer.step

    def interrupted(self, index):
        if index == 80:
            raise Stopped
        return step(self, index)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(BodyTrainer, "step", interrupted)
        with pytest.raises(Stopped):
            assemble(capture, folder / "out", assembly, said.append)
    before = HeadSource(folder / "out", 60, True).about()
    steps = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            BodyTrainer, "step", lambda self, index: steps.append(index) or step(self, index)
        )
        avatar = assemble(capture, folder / "out", assembly, said.append)
    return capture, folder, assembly, avatar, said, steps, before


def test_the_head_lands_where_it_is(made):
    """Within 2 mm RMS of the truth in every frame, in metres of the body's world."""
    capture, _, _, avatar, *_ = made
    means = avatar.head.model.means.detach().numpy().astype(float)
    for frame in range(FRAMES):
        found = moved(avatar.placement.world_from_head(frame), means)
        truth = moved(capture.true_world_from_head(frame), means)
        assert np.sqrt(np.square(found - truth).sum(1).mean()) < 0.002
    np.testing.assert_allclose(avatar.placement.canonical_from_head, ABROAD, atol=5e-3)
    drawn = avatar.head_gaussians(2 / capture.fps)
    sizes = drawn.scales / avatar.head.model.log_scales.detach().exp()
    assert float(sizes.mean()) == pytest.approx(1.1, rel=0.01)


def test_an_interrupted_run_goes_on(made):
    """From its checkpoint, with the head as it was."""
    _, folder, _, _, said, steps, before = made
    assert steps == list(range(60, STEPS_PER_FRAME * FRAMES))
    assert HeadSource(folder / "out", 60, True).about() == before
    assert sum(line.startswith("colours:") for line in said) == 1


def test_a_finished_avatar_is_only_read(made):
    """Nothing is measured or written again."""
    capture, folder, assembly, avatar, *_ = made
    times = {file: file.stat().st_mtime_ns for file in (folder / "out").rglob("*.*")}
    again = assemble(capture, folder / "out", assembly, pytest.fail)
    assert {file: file.stat().st_mtime_ns for file in times} == times
    for seconds in (0.0, 0.2):
        assert torch.equal(again.gaussians(seconds).means, avatar.gaussians(seconds).means)
    with pytest.raises(SettingsError, match=r"another 'joining\.border_points' \(60, not 9\)"):
        assemble(capture, folder / "out", assembly_of(folder / "head", border_points=9), print)


def test_the_body_keeps_clear_of_the_head(made):
    """At every moment that is looked at."""
    _, folder, _, avatar, *_ = made
    companion = HeadSource(folder / "out", 60, True).open(torch.device("cpu"))
    for model, window in zip(avatar.body.models, avatar.body.windows, strict=True):
        assert not Pruning(companion, window).trespassing(model).any()


def test_colours_match(made):
    """A quarter of the difference is left at most; what is said and kept are figures."""
    _, folder, _, avatar, said, *_ = made
    line = next(line for line in said if line.startswith("colours:"))
    before, after = (float(word.rstrip(".,")) for word in (line.split()[5], line.split()[-1]))
    assert after < 0.25 * before
    summary = json.loads((folder / "out" / "avatar.json").read_text())["summary"]
    assert summary == avatar.summary
    assert summary["psnr_face"] > 20 and summary["psnr_border"] > 18
    assert summary["color_step"] < 0.1 and summary["gap_mm"] < 30
    assert summary["settings"]["border_points"] == 60


def test_the_whole_person_is_measured(made):
    """By the test cameras: better than the body, which lacks a face."""
    capture, _, _, avatar, *_ = made
    whole = evaluate_body(avatar.body, capture, drawn=avatar)
    alone = evaluate_body(avatar.body, capture)
    assert whole["psnr_mask"] > alone["psnr_mask"] + 0.5
    assert [entry["camera"] for entry in whole["per_camera"]] == ["c1", "c6"]
    assert len(whole["per_frame"]) == FRAMES


def test_pictures_show_whether_the_head_fits(made, tmp_path):
    """Recorded, with the head over it, and with the landmarks, beside one another."""
    capture, folder, *_ = made
    write_checks(folder / "out", capture, tmp_path / "check")
    files = sorted((tmp_path / "check").iterdir())
    assert 6 <= len(files) <= 12
    assert {file.stem.split("_")[1] for file in files} <= {c.name for c in capture.cameras}
    for file in files:
        row = np.asarray(Image.open(file)).astype(float) / 255
        recorded, over, marked = np.split(row, 3, axis=1)
        assert np.abs(recorded - over).mean() < 0.04
        assert (np.abs(marked - recorded).max(-1) > 0.3).mean() > 0.02


def test_no_camera_in_front_for_the_seam(made, monkeypatch):
    """The gap alone is measured, and that is said: a finished training is not thrown away."""
    capture, _, _, avatar, *_ = made
    said = []
    backs = [i for i, c in enumerate(capture.cameras) if _behind(capture, c)]
    monkeypatch.setattr(capture, "split", replace(capture.split, test_cameras=tuple(backs)))
    found = measured(avatar, capture, said.append)
    assert set(found) == {"gap_mm"}
    assert "the seam in pictures is not measured" in said[-1]
    monkeypatch.setattr(module, "largest_gap", lambda *_: None)
    assert measured(avatar, capture, said.append) == {}


def _behind(capture, camera) -> bool:
    """Whether a camera is behind the head in all frames."""
    forward = np.stack([capture.true_world_from_head(f)[:3, 2] for f in range(FRAMES)])
    towards = camera.camera_to_world[:3, 3] - capture.true_world_from_head(0)[:3, 3]
    return bool((forward @ towards < 0).all())


def test_one_frame_is_an_avatar(tmp_path):
    """That stands still."""
    (tmp_path / "head").mkdir()
    planted_head().save(tmp_path / "head")
    capture = PlantedPerson(tmp_path / "capture")
    capture.num_frames = 1
    capture.split = replace(capture.split, train=(0,))
    avatar = assemble(
        capture, tmp_path / "out", assembly_of(tmp_path / "head", match_colors=False), print
    )
    assert len(avatar.expressions) == 1 and avatar.seconds == 0
    assert len(TrainedAvatar.load(tmp_path / "out").gaussians(0.4)) == len(avatar.gaussians(0.0))


def test_one_studio_is_the_identity(person):
    """With exact landmarks, exactly; the agreement is said in millimetres."""
    said = []
    person.landmarks_3d = lambda frame: face()
    placement = align(person, face(), said.append)
    np.testing.assert_allclose(placement.canonical_from_head, np.eye(4), atol=1e-12)
    for frame in range(FRAMES):
        np.testing.assert_allclose(
            placement.world_from_head(frame), person.world_from_head(frame), atol=1e-12
        )
    assert said == ["head on body: landmarks agree within 0.0 mm, scale 1.0000."]


def test_what_is_missing_is_said(person, head, tmp_path):
    """In one sentence each, before anything is trained."""
    person.landmarks = lambda camera, frame: None
    with pytest.raises(CaptureError, match="no landmarks of the face: find them with ico3d capt"):
        align(person, face(), print)


def test_impossible_settings_are_refused():
    """When they are given."""
    with pytest.raises(SettingsError, match="border_points=-1 is impossible"):
        JoiningSettings(border_points=-1)


def test_the_command_sorts_its_settings(tmp_path, capsys):
    """Some are the joining's, the rest the body's; going on from a body takes fewer steps."""
    places = [str(tmp_path)] * 3 + ["--preset", "paper"]
    words = ["--joining.no-pruning", "--steps", "900", "--joining.border-points", "5"]
    assembly = cli.parsed("assemble", [*places, *words]).assembly()
    assert assembly.joining == JoiningSettings(pruning=False, border_points=5)
    assert assembly.body.steps == 900 and assembly.body.warmup_steps == 1000
    on = cli.parsed("assemble", [*places, "--body", str(tmp_path / "body")]).assembly()
    assert (on.body.steps, on.body.warmup_steps) == (10_000, 0)
    assert on.about(tmp_path)["continued"] == str(tmp_path / "body")
    assert cli.main(["assemble", *places, "--joining.border-points", "-1"]) == 1
    assert "border_points=-1" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        cli.main(["assemble", *places, "--joining.border-point", "3"])
    assert "--joining.border-points" in capsys.readouterr().err


def test_a_planted_capture_is_a_capture(abroad):
    """What these tests stand on: one person in two studios, who differ in colour alone."""
    same = PlantedPerson(abroad.path)
    assert isinstance(abroad, Capture) and len(abroad.cameras) == len(same.cameras)
    for camera in (0, 3):
        np.testing.assert_allclose(abroad.mask(camera, 2), same.mask(camera, 2), atol=2e-3)
        ratio = abroad.image(camera, 2)[..., 2].mean() / same.image(camera, 2)[..., 2].mean()
        assert 0.6 < ratio < 0.95
