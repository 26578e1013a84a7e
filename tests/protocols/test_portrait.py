"""The protocol of talking portraits, and anybody's renders."""

import json
import shutil

import numpy as np
import pytest
from PIL import Image
from scipy.io import wavfile

from ico3d.capture.formats import open_capture
from ico3d.errors import CaptureError, SettingsError
from ico3d.head.settings import PRESETS
from ico3d.protocols.commands import MeasurePortrait, MeasureRenders
from ico3d.protocols.renders import face_box
from ico3d.studio.layouts.portrait import write_portrait
from support.heads.tiny_talker import TinyTalker, face_points
from support.settings import changed

pytestmark = pytest.mark.slow

TINY = {
    "steps": 60,
    "network.features": 8,
    "network.hidden": 16,
    "initial.gaussians": 200,
    "density.until": 0,
}


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """A portrait, its report for two seeds, and the command."""
    folder = tmp_path_factory.mktemp("portraits")
    write_portrait(TinyTalker(folder / "talker"), folder / "portrait")
    tone = np.sin(np.arange(8000) / 9) * 9000  # half a second
    wavfile.write(folder / "tone.wav", 16_000, tone.astype(np.int16))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ICO3D_MODELS", str(folder))
        command = MeasurePortrait(
            folder / "portrait",
            folder / "out",
            seeds=2,
            sounds=(folder / "tone.wav",),
            against=(folder / "portrait",),
            settings=changed(PRESETS["cpu"], TINY),
        )
        command.run()
    return folder, command


def test_heads_are_compared_over_the_recorded_torso(measured):
    folder, _ = measured
    told = json.loads((folder / "out" / "report.json").read_text())
    first, second = told["figures"]["self-driven"]
    assert first["psnr"] != second["psnr"] and min(first["psnr"], second["psnr"]) > 20
    assert first["face_psnr"] < first["psnr"] + 5 and first["psnr_mask"] > 12
    test = open_capture(folder / "portrait").split.test
    pictures = sorted((folder / "out" / "seed1" / "pictures" / "pred" / "0").iterdir())
    assert [int(p.stem) for p in pictures] == list(test)
    drawn = np.asarray(Image.open(pictures[0]), float) / 255
    recorded = open_capture(folder / "portrait").image(0, test[0])
    assert np.abs(drawn - recorded)[-6:].max() < 0.02, "shoulders are the recorded ones"
    assert told["facts"]["settings"]["steps"] == 60


def test_a_sound_drives_heads_for_as_long_as_it_lasts(measured):
    folder, _ = measured
    pictures = sorted((folder / "out" / "seed0" / "to-tone").iterdir())
    assert len(pictures) == 12  # 25 per second
    text = (folder / "out" / "report.md").read_text()
    assert "| tone, seed 1 |" in text or "Not measured here" in text.split("Cross-driven")[1]
    for name in ("strip.png", "training.png"):
        assert (folder / "out" / name).is_file() and f"]({name})" in text
    assert "| mean |" in text and "Sync-C" in text


def test_what_is_there_is_not_trained_again(measured):
    folder, command = measured
    before = (folder / "out" / "seed0" / "model.safetensors").stat().st_mtime_ns
    command.run()
    assert (folder / "out" / "seed0" / "model.safetensors").stat().st_mtime_ns == before


def test_anybodys_pictures_are_scored_alike(measured, monkeypatch, capsys):
    folder, _ = measured
    monkeypatch.setenv("ICO3D_MODELS", str(folder))
    sides = [folder / "out" / "seed0" / "pictures" / part / "0" for part in ("gt", "pred", "mask")]
    shutil.copytree(sides[0], folder / "perfect", dirs_exist_ok=True)
    MeasureRenders(folder / "r", sides[0], (sides[1], folder / "perfect"), sides[2]).run()
    ours, perfect = json.loads((folder / "r" / "report.json").read_text())["figures"]["rows"]
    own = json.loads((folder / "out" / "report.json").read_text())["figures"]["self-driven"][0]
    assert ours["psnr"] == pytest.approx(own["psnr"], abs=0.1)  # of pictures with 8 bits
    assert ours["psnr_mask"] == pytest.approx(own["psnr_mask"], abs=0.1)
    assert perfect["psnr"] == 120 and perfect["ssim"] == pytest.approx(1, abs=1e-4)
    assert "perfect" in capsys.readouterr().out


def test_a_face_crop_holds_all_landmarks():
    marks = face_points()[:, :2] * 100 + 50
    aside = np.array([10, 0])
    box = face_box([marks, marks + aside])
    low, high = marks.min(0), marks.max(0) + aside
    margin = 0.25 * (high - low).max()
    assert box.left == int(np.floor(low[0] - margin)) and box.top == int(np.floor(low[1] - margin))
    assert box.left + box.width == int(np.ceil(high[0] + margin))
    assert face_box([]) is None


def test_bad_input_is_one_sentence(measured, tmp_path):
    folder, _ = measured
    with pytest.raises(SettingsError, match="--seeds"):
        MeasurePortrait(folder / "portrait", tmp_path, seeds=0).run()
    with pytest.raises(CaptureError, match="no sound at"):
        MeasureRenders(tmp_path, folder / "perfect", (folder / "perfect",), sound=tmp_path).run()
