"""`ico3d animate` on a body, an avatar and a bundle."""

import json

import pytest
from PIL import Image

from ico3d.avatar.animation.animated import open_person
from ico3d.bundle.animation import Action, Animation, Rest
from ico3d.cli import main
from ico3d.splat.device import CPU
from support.avatars.whole_person import FRAMES, WholeFilmed, write_whole_person
from support.bundles.random_body import write_random_body
from support.bundles.random_bundle import write_random_bundle
from support.bundles.random_whole import ANIMATION, write_random_whole
from support.captures import open_with

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def avatar(tmp_path_factory):
    folder = tmp_path_factory.mktemp("avatar")
    write_whole_person(folder)
    return folder


def test_what_is_found_is_written_and_drawn(avatar, tmp_path, capsys):
    out, sheet = tmp_path / "animation.json", tmp_path / "sheet.jpg"
    words = ["animate", str(avatar), "--out", str(out), "--contact-sheet", str(sheet)]
    assert main(words) == 0
    animation = Animation.from_bytes(out.read_bytes())
    assert animation.num_frames == FRAMES and animation.fps == 15.0
    printed = capsys.readouterr().out
    assert "rest start" in printed and "rest end" in printed
    with Image.open(sheet) as picture:
        assert picture.format == "JPEG" and picture.size == (1200, 660)
        low, high = picture.convert("L").getextrema()
    assert high - low > 200


def test_gestures_that_look_bad_are_refused(avatar, tmp_path, capsys, monkeypatch):
    person = open_person(avatar, CPU).avatar
    capture = WholeFilmed(person, tmp_path / "body")
    picture = capture.image

    def image(camera, frame):  # the model has learnt nothing of these frames
        return picture(camera, 0)[::-1].copy() if 9 <= frame <= 10 else picture(camera, frame)

    monkeypatch.setattr(capture, "image", image)
    open_with(monkeypatch, lambda path: capture)
    asked = Animation(15.0, FRAMES, Rest(1, 5), (Action(7, 0.5), Action(9, 1.0), Action(12, 0.8)))
    (avatar / "animation.json").write_bytes(asked.to_bytes())
    out, sheet = tmp_path / "animation.json", tmp_path / "sheet.png"
    words = ["animate", str(avatar), "--capture", "body", "--out", str(out)]
    assert main([*words, "--contact-sheet", str(sheet)]) == 0
    (avatar / "animation.json").unlink()
    assert Animation.from_bytes(out.read_bytes()).actions == (Action(7, 0.5),)
    printed = capsys.readouterr().out
    assert "frames 9 to 10 fall far below the clip's own quality" in printed
    rows = [line.split("│") for line in printed.splitlines() if "refused" in line]
    assert {"9", "12"} <= {row[1].strip() for row in rows}
    assert Image.open(sheet).size[1] == 960  # with the curve of the pictures


def test_what_was_edited_is_shown(avatar, capsys):
    file = avatar / "body" / "animation.json"
    assert main(["animate", str(avatar / "body"), "--out", str(file)]) == 0
    values = json.loads(file.read_text())
    values["actions"] = [{"frame": 9, "score": 0.125}]
    file.write_text(json.dumps(values))
    capsys.readouterr()
    assert main(["animate", str(avatar / "body")]) == 0
    (row,) = [line for line in capsys.readouterr().out.splitlines() if "action" in line]
    assert row.split("│")[1].strip() == "9" and "0.125" in row
    values["actions"][0]["frame"] = 99
    file.write_text(json.dumps(values))
    assert main(["animate", str(avatar / "body")]) == 1
    error = capsys.readouterr().err
    assert f"{avatar / 'body'}: animation.json: actions[0].frame must lie between 0 and" in error
    file.write_text(json.dumps(values | {"num_frames": 200}))
    assert main(["animate", str(avatar / "body")]) == 1
    assert f"is for a body of 200 frames at 15 per second, but this one has {FRAMES}" in (
        capsys.readouterr().err
    )


def test_a_bundle_shows_its_own(tmp_path, capsys):
    path, out = tmp_path / "person.ico3d", tmp_path / "animation.json"
    write_random_whole(path)
    sheet = tmp_path / "sheet.png"
    words = ["animate", str(path), "--out", str(out), "--contact-sheet", str(sheet)]
    assert main(words) == 0
    assert json.loads(out.read_text()) == ANIMATION
    rows = [
        line.split("│")[1].strip() for line in capsys.readouterr().out.splitlines() if "│" in line
    ]
    assert rows == ["0", "2", "4", "6"]
    assert Image.open(sheet).format == "PNG"


def test_a_body_alone_in_a_bundle_is_searched(tmp_path):
    path, out = tmp_path / "body.ico3d", tmp_path / "animation.json"
    write_random_body(path)
    assert main(["animate", str(path), "--out", str(out)]) == 0
    assert Animation.from_bytes(out.read_bytes()).num_frames == 7


def test_what_has_no_body_is_refused(tmp_path, capsys):
    path = tmp_path / "head.ico3d"
    write_random_bundle(path, 60)
    assert main(["animate", str(path)]) == 1
    assert "has no body" in capsys.readouterr().err
    assert main(["animate", str(path), "--contact-sheet", "a.txt"]) == 1
    assert "NAME.jpg or NAME.png" in capsys.readouterr().err
