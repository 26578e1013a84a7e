"""From one recording of the whole person to head and avatar; its test cameras teach nothing."""

import json
from dataclasses import replace

import pytest

from ico3d import cli
from ico3d.avatar.avatar import TrainedAvatar
from ico3d.avatar.joining import assemble as module
from ico3d.avatar.joining.assemble import assemble
from ico3d.capture import formats
from ico3d.capture.parts.head_of_body import head_in
from ico3d.head.model_folder import TrainedHead
from ico3d.head.settings import PRESETS
from ico3d.head.train_head import HeadJob, train_head
from support.avatars.planted_person import FRAMES, PlantedPerson, face
from support.avatars.tiny_joining import assembly_of
from support.settings import changed

pytestmark = pytest.mark.slow

TESTED = {3, 8}
TINY = {
    "steps": 150,
    "initial.gaussians": 400,
    "density.max_gaussians": 500,
    "density.begin": 200,
    "checkpoint_every": 200,
}


class LockedPerson(PlantedPerson):
    """Whoever looks at a test camera's picture, mask or landmarks while it is locked fails."""

    locked = True

    def _picture(self, camera, frame):
        assert not (self.locked and camera in TESTED), "a test camera's picture was read"
        return super()._picture(camera, frame)

    def landmarks(self, camera, frame):
        assert not (self.locked and camera in TESTED), "a test camera's landmarks were read"
        return super().landmarks(camera, frame)

    def landmarks_3d(self, frame):
        return face()


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The recording, and a folder with a head and an avatar that were both made of it."""
    folder = tmp_path_factory.mktemp("one")
    capture, said = LockedPerson(folder / "capture"), []
    settings = changed(PRESETS["cpu"], TINY)
    train_head(capture, folder / "head", HeadJob("blendshapes", "full", "builtin", 0, settings))
    assembly = assembly_of(folder / "head")
    body = changed(assembly.body, {"steps_per_frame": 6, "warmup_steps": 0})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "measured", lambda *_: {})  # which reads test pictures, rightly
        # one window, as motion need not be measured for that
        assembly = replace(assembly, body=body, method="static")
        assemble(capture, folder / "avatar", assembly, said.append)
    capture.locked = False
    return capture, folder, said


def _evaluate(made, monkeypatch, model, *words) -> int:
    """The exit status of `ico3d evaluate`."""
    capture, folder, _ = made
    monkeypatch.setattr(formats, "open_capture", lambda _: capture)
    return cli.main(["evaluate", str(folder / model), str(folder), *words])


def test_the_folders_tell_what_trained(made):
    """Cameras and frames, in each of them; a head's torso had no weight, and that is told, too."""
    capture, folder, said = made
    cameras = [c.name for i, c in enumerate(capture.cameras) if i not in TESTED]
    head = json.loads((folder / "head" / "head.json").read_text())["summary"]
    body = json.loads((folder / "avatar" / "body" / "body.json").read_text())["summary"]
    for summary in (head, body):
        assert summary["recording"]["cameras"] == cameras
        assert summary["recording"]["frames"] == [[0, FRAMES - 1]]
    assert head["settings"]["loss"]["torso"] == 0.0
    avatar = json.loads((folder / "avatar" / "avatar.json").read_text())["summary"]
    assert [r["cameras"] for r in avatar["trained_on"] if r] == [cameras, cameras]
    assert TrainedAvatar.load(folder / "avatar").records[0]["path"] == str(capture.path.resolve())
    assert "colours: head and body are of one recording, so there is nothing to match." in said


def test_the_head_is_that_of_the_person(made, monkeypatch, capsys):
    """By the test cameras, on the head alone; lips move, so a resting face is worse."""
    capture, folder, _ = made
    out = folder / "metrics.json"
    assert _evaluate(made, monkeypatch, "head", "--json", str(out)) == 0
    assert json.loads(out.read_text())["psnr_mask"] > 23
    head = TrainedHead.load(folder / "head")
    assert head_in(capture).head_points().shape[1] == 3
    assert float(head.model.means.detach().norm(dim=1).median()) < 0.15  # in head space


@pytest.mark.parametrize("model", ["head", "avatar"])
def test_what_trained_cannot_test(made, monkeypatch, capsys, model):
    """The validation camera was not held out here; test cameras were; all is what was asked for."""
    assert _evaluate(made, monkeypatch, model, "--frames", "validation") == 1
    assert "frame 0 by camera c0 trained this model" in capsys.readouterr().err
    capture = made[0]
    with monkeypatch.context() as patch:
        moved = replace(capture.split, test_cameras=(2,))
        patch.setattr(capture, "split", moved)
        assert _evaluate(made, monkeypatch, model) == 1
        assert "frame 0 by camera c2 trained this model" in capsys.readouterr().err


def test_a_held_out_camera_validates(made, tmp_path, monkeypatch, capsys):
    """After a training without it; interrupted runs with and without it are others."""
    capture, _, _ = made
    settings = changed(PRESETS["cpu"], TINY | {"steps": 2})
    job = HeadJob("blendshapes", "full", "builtin", 0, settings, hold_out=True)
    head = train_head(capture, tmp_path / "head", job)
    assert "c0" not in head.records[0]["cameras"]
    assert _evaluate((capture, tmp_path, []), monkeypatch, "head", "--frames", "validation") == 0
    assert cli.main(["evaluate", str(tmp_path / "head"), str(tmp_path), "--frames", "test"]) == 0
