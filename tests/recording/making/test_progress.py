"""What the page is shown while an avatar is made."""

from pathlib import Path

import numpy as np
from PIL import Image

from ico3d.creating.events import Advanced, Looked, Made, Measured, Planned, Preview, Voiced
from ico3d.creating.looking.advice import Advice
from ico3d.creating.looking.examine import Examination
from ico3d.recording.making.progress import (
    FACE,
    Progress,
    Reporter,
    begun,
    read_progress,
    shown_face,
    write_progress,
)
from support.strangers.not_ours import replacements

ADVICE = (Advice("blur", spans=((2, 3),)), Advice("face-none", "refused"))
BLUR = {"code": "blur", "level": "better", "values": {}, "spans": [[2, 3]], "detail": ""}


def test_events_become_steps_time_and_pictures(tmp_path):
    clock = [0.0]
    tell = Reporter(tmp_path, Progress("running", "quick"), lambda: clock[0])
    tell(Looked(Path("x.mp4"), Examination(30.0, 25.0, 512**2, ADVICE, True)))
    tell(Planned({"track": 10.0, "learn": 100.0, "measure": 5.0}, {}))
    found = read_progress(tmp_path)
    assert found is not None
    assert (found.left, found.advice, found.step) == (115.0, (BLUR,), "join")
    assert [one["code"] for one in found.refused] == ["face-none"]
    clock[0] = 5.0
    tell(Advanced("track", 0.5, "…"))
    assert tell.progress.left == 110.0
    tell(Advanced("learn", 0.25, "…"))
    tell(Advanced("learn", 0.5, "…"))  # at once: not written
    assert (tell.progress.share, tell.progress.left) == (0.25, 80.0)
    clock[0] = 7.0
    tell(Advanced("learn", 0.75, "…"))
    assert (tell.progress.share, tell.progress.left) == (
        0.75,
        1.2,
    )  # 4 s, and not 100, for all of it
    tell(Preview(0.75, np.zeros((4, 8, 3), np.uint8)))
    with Image.open(tmp_path / FACE) as picture:
        assert picture.size == (8, 4)
    tell(Made(Path("x.ico3d"), Path("strip.png"), Measured(30.5, None, 3), 1.0))
    found = read_progress(tmp_path)
    assert found == tell.progress
    assert (found.step, found.faces, found.decibels, found.left) == ("bake", 1, 30.5, 0.0)


def test_the_time_left_counts_down_between_reports_to_what_later_steps_need(tmp_path):
    clock = [0.0]
    tell = Reporter(tmp_path, Progress("running", "quick"), *[lambda: clock[0]] * 2)

    def shown():
        found = read_progress(tmp_path)
        assert found is not None
        return found.left_at(clock[0])

    tell.change()
    assert shown() is None
    tell(Planned({"track": 60.0, "learn": 100.0, "measure": 20.0}, {}))
    for clock[0], left in ((0.0, 180.0), (1.5, 178.5), (40.0, 140.0), (90.0, 120.0)):
        assert shown() == left
    tell(Advanced("learn", 0.0, "…"))
    clock[0] = 91.5
    assert shown() == 118.5
    tell(Preview(0.1, np.zeros((4, 8, 3), np.uint8)))  # says nothing of the time
    clock[0] = 100.0
    assert shown() == 110.0
    clock[0] = 80.0  # set back
    assert shown() == 120.0


def test_why_there_is_no_voice_is_among_the_advice(tmp_path):
    tell = Reporter(tmp_path, Progress("running", "quick"))
    tell(Looked(Path("x.mp4"), Examination(30.0, 25.0, 512**2, ADVICE, True)))
    tell(Voiced(30.0))
    assert len(tell.progress.advice) == 1
    lacking = "openvoice is not installed."
    tell(Voiced(0.0, Advice("voice-short", values={"n": 4, "least": 10})))
    tell(Voiced(0.0, Advice("voice-lacking", detail=lacking)))
    found = read_progress(tmp_path)
    assert found is not None
    short, missing = found.advice[1:]
    assert (short["code"], short["values"]) == ("voice-short", {"n": 4, "least": 10})
    assert (missing["code"], missing["detail"]) == ("voice-lacking", lacking)


ODD_PAIRS = [('"running"', text) for text in ("5", "null", '["x"]', '"better"', "{}")]
DEEP = "[" * 700 + "]" * 700
ODD_PAIRS += [(text, '"good"') for text in ("5", "null", '["x"]', '"going"')]


def test_of_a_strangers_picture_nothing_is_shown_that_takes_gigabytes(tmp_path):
    assert shown_face(tmp_path) is None
    for kind, size in (("PNG", (64, 32)), ("JPEG", (5000, 16)), ("GIF", (64, 32))):
        Image.new("L", size).save(tmp_path / FACE, kind)
        assert shown_face(tmp_path) is None
    Image.new("L", (4000, 2000)).save(tmp_path / FACE)
    assert shown_face(tmp_path) == (tmp_path / FACE).read_bytes()
    (tmp_path / FACE).write_bytes(bytes(2 << 20))
    assert shown_face(tmp_path) is None


def test_what_is_damaged_is_nothing(tmp_path):
    assert read_progress(tmp_path) is None
    whole = '{"state": "made", "quality": "good", "%s": %s}'
    odd = [whole % ("made_of", "3"), whole % ("decibels", "Infinity"), "[" * 100_000]
    odd += [whole % ("decibels", "1e999"), whole % ("step", '"fly"')]
    odd += [whole % ("advice", "[" + "[]," * 30_000 + "[]]")]
    odd += [f'{{"state": {state}, "quality": {quality}}}' for state, quality in ODD_PAIRS]
    odd += [
        whole % (name, DEEP) for name in ("error", "faces", "advice", "values", "step", "share")
    ]
    odd += [whole % (name, '"nan"') for name in ("left", "later", "told", "share", "decibels")]
    odd += [
        whole % ("faces", "-1"),
        whole % ("error", "[]"),
        whole % ("made_of", f'{{"x": {DEEP}}}'),
    ]
    odd += [whole % ("told", '"x"'), whole % ("left", "[]"), whole % ("later", "9" * 400)]
    for text in ("{", "[]", '{"state": "running"}', '{"advice": [], "x": 1}', *odd):
        (tmp_path / "progress.json").write_text(text)
        assert read_progress(tmp_path) is None


def test_a_progress_of_an_earlier_version_is_read(tmp_path):
    (tmp_path / "progress.json").write_text(
        '{"state": "made", "quality": "good", "advice": ["it is blurred."]}'
    )
    found = read_progress(tmp_path)
    assert found is not None
    assert (found.state, found.advice, found.refused) == ("made", ("it is blurred.",), ())


def test_what_goes_on_keeps_its_pictures_and_of_what_it_is_made(tmp_path):
    assert begun(tmp_path, "good").made_of == {}
    before = Progress("stopped", "quick", "learn", 0.4, faces=3, made_of={"on": ["demo"]})
    write_progress(tmp_path, before)
    assert begun(tmp_path, "good") == Progress("running", "good", faces=3, made_of={"on": ["demo"]})
    assert begun(tmp_path, "good", {"on": []}).made_of == {"on": []}


def test_what_lies_elsewhere_is_no_progress(tmp_path):
    progress = Progress("made", "quick")
    write_progress(tmp_path, progress)
    for _ in replacements(tmp_path / "progress.json"):
        assert read_progress(tmp_path) is None
    assert read_progress(tmp_path) == progress
