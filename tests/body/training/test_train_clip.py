"""From a capture to a model folder."""

import json

import pytest
import torch

from ico3d.body.model_folder import TrainedBody
from ico3d.body.planning.windows import Window
from ico3d.body.training.needs import needs_of_body
from ico3d.body.training.train_clip import plan_windows, train_body
from ico3d.errors import SettingsError
from support.bodies.moving_capture import FRAMES, MovingCapture
from support.bodies.tiny_training import job

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """A capture, the folder of its body, and the body."""
    folder = tmp_path_factory.mktemp("body")
    capture = MovingCapture(folder / "capture")
    return capture, folder / "model", train_body(capture, folder / "model", job())


def test_windows_cover_the_clip(trained):
    """They share one frame; the plan on disk and its picture are those that were trained."""
    _, folder, body = trained
    assert body.windows[0].first == 0 and body.windows[-1].last == FRAMES - 1
    assert all(a.last == b.first for a, b in zip(body.windows, body.windows[1:], strict=False))
    plan = json.loads((folder / "plan.json").read_text())
    assert [Window(**window) for window in plan["windows"]] == list(body.windows)
    assert (folder / "plan.png").read_bytes().startswith(b"\x89PNG")


def test_a_plan_is_drawn_once(trained):
    """And again where its picture is missing, or shows another."""
    capture, folder, _ = trained
    picture = folder / "plan.png"

    def drawn(work):
        before = picture.stat().st_ino
        plan_windows(capture, work, folder)
        return picture.stat().st_ino != before

    longer = job(**{"windows.longest": 7})
    assert [drawn(work) for work in (job(), longer, longer, job())] == [False, True, False, True]
    picture.unlink()
    plan_windows(capture, job(), folder)
    assert picture.is_file()


def test_the_folder_holds_the_body(trained):
    """The fine-tuned windows, bit by bit, and how they were made."""
    _, folder, body = trained
    loaded = TrainedBody.load(folder)
    for a, b in zip(body.models, loaded.models, strict=True):
        assert torch.equal(a.at(0.4).means, b.at(0.4).means)
    files = [entry["file"] for entry in json.loads((folder / "body.json").read_text())["windows"]]
    assert files[0].startswith("windows/") and files[1].startswith("finetuned/")
    assert loaded.summary["settings"]["density"]["max_gaussians"] == 90
    assert loaded.summary["capture"]["kind"] == "moving"


def test_a_body_of_an_earlier_version_opens(trained):
    """Settings had other names."""
    _, folder, body = trained
    about = json.loads((folder / "body.json").read_text())
    about["summary"]["settings"] = {"max_gaussians": 90, "grid_space": 4}
    (folder / "old.json").write_text(json.dumps(about))
    old = TrainedBody.load(folder, "old.json")
    assert torch.equal(old.gaussians(0.1).means, body.gaussians(0.1).means)


def test_a_finished_run_is_loaded(trained):
    """The same command does nothing; other settings are refused."""
    capture, folder, body = trained
    again = train_body(capture, folder, job())
    assert torch.equal(again.models[1].at(0.5).means, body.models[1].at(0.5).means)
    with pytest.raises(SettingsError, match=r"another 'density\.max_gaussians' \(90, not 80\)"):
        train_body(capture, folder, job(**{"density.max_gaussians": 80}))


def test_the_same_seed_gives_the_same_body(trained, tmp_path):
    """And another seed another one."""
    capture, _, body = trained
    same = train_body(capture, tmp_path / "same", job(**{"finetune.steps": 0}))
    other = train_body(capture, tmp_path / "other", job(**{"finetune.steps": 0}, seed=1))
    first = [some.models[0].at(1.0).means for some in (body, same, other)]
    assert torch.equal(first[0], first[1])
    assert first[0].shape != first[2].shape or not torch.equal(first[0], first[2])


def test_a_dry_run_says_what_the_run_takes(trained, tmp_path):
    """Within a factor of ten, on a machine that others use; only the plan is written."""
    capture, folder, body = trained
    needs = needs_of_body(capture, tmp_path / "dry", job())
    low, high = needs.seconds
    assert low / 10 <= body.summary["train_seconds"] <= high * 10
    assert needs.parts == len(body.windows)
    files = list((folder / "windows").glob("*/window.safetensors"))
    assert max(file.stat().st_size for file in files) <= needs.end.kept + 20_000
    assert not {"settings.json", "windows"} & {p.name for p in (tmp_path / "dry").iterdir()}


@pytest.mark.parametrize("method", ["4dgs", "spacetime", "freetime"])
def test_some_methods_take_the_clip_as_one_window(trained, tmp_path, method):
    """So there is nothing to plan, and nothing to fine-tune."""
    body = train_body(trained[0], tmp_path / method, job(method))
    assert body.windows == (Window(0, FRAMES - 1),)
    written = {path.name for path in (tmp_path / method).iterdir()}
    assert written == {"body.json", "finished.json", "settings.json", "state.json", "windows"}
    with pytest.raises(SettingsError, match=f"--method {method} takes the clip as one window"):
        plan_windows(trained[0], job(method), tmp_path / method)
