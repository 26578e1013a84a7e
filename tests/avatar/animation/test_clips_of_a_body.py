"""`ico3d animate` and `ico3d bake` on a body that waved when it was recorded."""

from functools import partial

import pytest
from PIL import Image

from ico3d.avatar.animation.clip_sheet import frames_of
from ico3d.body.model_folder import TrainedBody, save_window
from ico3d.body.planning.windows import Window
from ico3d.bundle.format import Bundle
from ico3d.cli import main
from ico3d.motion.gestures.library import library
from ico3d.motion.person import person_of
from ico3d.motion.recorded.cut import Cut
from support.avatars.origins import MADE, origin
from support.avatars.whole_person import write_whole_person
from support.bodies.skinned_model import trained_like
from support.recorded import body_of, made_still
from support.rigs import rig_of

pytestmark = pytest.mark.slow
FPS = 15.0


@pytest.fixture
def body(tmp_path):
    """The folder of a trained body."""
    rig = rig_of("SMPL-X", 0.0)
    person = person_of(rig)
    rotations = made_still(person, library(person, ("wave",))["wave"], FPS)
    model = trained_like(body_of(rig, FPS, rotations, 0 * rotations[:, 0, :3], 60))
    about = origin("computed")
    windows = (Window(0, len(rotations) - 1),)
    folder = tmp_path / "body"
    folder.mkdir()
    save_window(folder / "window.safetensors", model)
    TrainedBody([model], windows, FPS, "skinned", {"capture": about}).save(
        folder, ["window.safetensors"]
    )
    return folder


def rows(printed: str) -> list[list[str]]:
    """The table of clips."""
    table = printed[printed.index("stroke") :].splitlines()
    return [[cell.strip() for cell in line.split("│")[1:-1]] for line in table if "│" in line]


def test_clips_are_shown_renamed_and_baked(body, tmp_path, capsys, monkeypatch):
    file, sheet = body / "clips.toml", tmp_path / "sheet.png"
    assert main(["animate", str(body), "--clips", str(file)]) == 0
    assert [row[:2] for row in rows(capsys.readouterr().out)] == [
        ["rest", "both"],
        ["wave", "right"],
    ]
    file.write_text(file.read_text().replace('"wave"', '"take_a_bow"'))
    with monkeypatch.context() as patch:  # of the package's gestures one is drawn besides
        patch.setattr("ico3d.avatar.poseable.library", partial(library, names=("nod",)))
        assert main(["animate", str(body), "--contact-sheet", str(sheet)]) == 0
    assert [row[0] for row in rows(capsys.readouterr().out)] == ["rest", "take_a_bow"]
    with Image.open(sheet) as picture:
        assert picture.size == (1200, 1540)  # the last two rows are clips
    out, again = tmp_path / "a.ico3d", tmp_path / "again.toml"
    some = partial(library, names=("wave",))
    monkeypatch.setattr("ico3d.bundle.skinned.gestures.library", some)
    assert main(["bake", str(body), str(out), "--device", "cpu", "--force", *MADE]) == 0
    bundle = Bundle.open(out)
    assert bundle.gestures is not None and {"take_a_bow", "wave"} <= set(bundle.gestures)
    assert main(["animate", str(out), "--clips", str(again)]) == 0
    assert again.read_text() == file.read_text()
    file.write_text(file.read_text().replace("num_frames = ", "num_frames = 1"))
    capsys.readouterr()
    for verb in (["animate", str(body)], ["bake", str(body), str(out), *MADE, "--device", "cpu"]):
        assert main(verb) == 1
        assert "is of a recording of" in " ".join(capsys.readouterr().err.split())


def test_a_body_of_windows_has_no_clips(tmp_path, capsys):
    write_whole_person(tmp_path)
    assert main(["animate", str(tmp_path), "--clips", str(tmp_path / "clips.toml")]) == 1
    error = " ".join(capsys.readouterr().err.split())
    assert "has no skeleton of a person: clips are cut from a body that was trained with" in error


def test_a_row_shows_how_a_clip_begins_its_stroke_and_how_it_ends():
    assert frames_of(Cut("wave", "right", 3, 10, 14, 20)) == [3, 6, 10, 14, 17, 20]
    assert frames_of(Cut("nod", "none", 3, 4, 4, 6)) == [3, 4, 5, 6]
