"""The plan of windows, written and shown."""

import json
from dataclasses import asdict

import numpy as np
import pytest
from PIL import Image
from rich.console import Console

from ico3d.body.planning.plan import make_plan, print_plan, save_plan
from ico3d.body.planning.plan_picture import draw_plan
from ico3d.body.planning.windows import Window
from ico3d.body.settings import Windows

pytestmark = pytest.mark.slow

HEIGHTS = np.cumsum([0, *[0.0] * 4, *[0.1] * 3, *[0.0] * 3, *[-0.12] * 2])


@pytest.fixture
def planned(moving_ball, tmp_path):
    capture = moving_ball(HEIGHTS)
    return capture, make_plan(capture, Windows(50.0, 3, 6), tmp_path / "model")


def test_windows_follow_the_motion(planned):
    capture, plan = planned
    assert plan.windows == (Window(0, 4), Window(4, 9), Window(9, 12))
    assert len(plan.motion) == capture.num_frames - 1 and plan.fps == 15
    moved = [plan.moved(window) for window in plan.windows]
    assert moved[0] < 0.01 and moved[1] > 10 and moved[2] > 10
    assert sum(moved) == pytest.approx(sum(plan.motion))
    assert plan.busiest in (0, 1, 2, 3, 5, 6)


def test_a_plan_is_written_whole(planned, tmp_path):
    _, plan = planned
    file = tmp_path / "plan.json"
    save_plan(plan, file)
    written = json.loads(file.read_text())
    assert written == json.loads(json.dumps(asdict(plan)))
    assert written["windows"][1] == {"first": 4, "last": 9} and written["method"] == plan.method


def test_a_plan_is_shown_as_a_table(planned):
    _, plan = planned
    console = Console(width=100)
    with console.capture() as shown:
        print_plan(plan, console)
    lines = shown.get().splitlines()
    assert "3 windows of 3 to 6 frames, up to 50 cm²" in lines[0]
    rows = [line for line in lines if line.startswith("│")]
    assert len(rows) == 3 and "4 – 9" in rows[1] and "0.27 – 0.60" in rows[1]
    assert "▁▁▁▁" in rows[0] and "█" in "".join(rows[1:])


def test_a_plan_is_drawn(planned, tmp_path):
    capture, plan = planned
    file = tmp_path / "plan.png"
    draw_plan(plan, capture, file)
    with Image.open(file) as picture:
        assert picture.size == (1400, 750)
        pixels = np.asarray(picture.convert("RGB")).reshape(-1, 3)
    # the bars of the second and third window; the first has none to see
    for color in ((255, 127, 14), (44, 160, 44)):
        assert (np.abs(pixels - color).max(1) < 3).sum() > 1000
    # the ball in the pictures
    assert ((pixels[:, 0] > 200) & (pixels[:, 1] < 130) & (pixels[:, 2] < 60)).sum() > 300


def test_a_clip_of_one_frame_is_drawn(moving_ball, tmp_path):
    capture = moving_ball([0.0])
    plan = make_plan(capture, Windows(100.0, 6, 16), tmp_path)
    assert plan.windows == (Window(0, 0),) and plan.motion == ()
    print_plan(plan, Console(quiet=True))
    draw_plan(plan, capture, tmp_path / "plan.png")
    assert (tmp_path / "plan.png").stat().st_size > 1000
