"""Films of a body: paths of cameras, time, and the file."""

import json
import shutil
from pathlib import Path

import av
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ico3d.avatar.camera_path import orbit, read_key_cameras, ring_around, ring_of, through
from ico3d.avatar.film.command import Render
from ico3d.avatar.film.film import pictures
from ico3d.avatar.film.video import write_video
from ico3d.avatar.moving import back_and_forth, extent
from ico3d.common.camera import look_at
from ico3d.common.files import SPARE
from ico3d.errors import CaptureError, ModelError, SettingsError, StorageError
from support.bodies.moving_capture import MovingCapture
from support.bodies.true_body import still_body, true_body
from support.captures import open_with

WIDTH, HEIGHT = 64, 96


@pytest.fixture(scope="module")
def capture():
    return MovingCapture(Path("moving"))


@pytest.fixture(scope="module")
def points(capture):
    return extent(true_body(capture))


def test_an_orbit_goes_around_once_and_keeps_the_person_in_sight(capture, points):
    ring = ring_around(points)
    cameras = orbit(ring, points, 24, WIDTH, HEIGHT)
    eyes = np.stack([camera.camera_to_world[:3, 3] for camera in cameras])
    np.testing.assert_allclose(eyes[0], ring.start, atol=1e-9)
    np.testing.assert_allclose(eyes[:, 1], ring.start[1], atol=1e-9)
    angles = np.unwrap(np.arctan2(*(eyes - ring.middle)[:, (0, 2)].T))
    np.testing.assert_allclose(np.diff(angles), 2 * np.pi / 24, atol=1e-9)
    margins = []
    for camera in cameras:
        pixels, depths = camera.project(points)
        assert (depths > 0).all()
        margins.append(np.min([pixels, (WIDTH, HEIGHT) - pixels]))
    assert 0 < min(margins) < 12


def test_an_orbit_stands_as_the_cameras_of_the_capture(capture, points):
    ring = ring_of(capture.cameras, points)
    middles = np.stack([camera.camera_to_world[:3, 3] for camera in capture.cameras])
    assert abs(ring.up[1]) > 0.99
    assert np.linalg.norm((ring.start - ring.middle)[[0, 2]]) == pytest.approx(2.2, rel=0.03)
    assert ring.start[1] == pytest.approx(middles[:, 1].mean(), abs=0.06)
    beside = ring.start - middles[0]  # the first camera stands right above, at (0, 0.5, 2.2)
    assert np.linalg.norm(beside[[0, 2]]) < 0.1


def test_an_orbit_needs_cameras_around(capture, points):
    with pytest.raises(CaptureError, match="do not stand around"):
        ring_of([capture.cameras[0]], points)


@given(st.floats(0, 50), st.floats(0.1, 5))
def test_time_runs_back_and_forth(seconds, length):
    assert 0 <= back_and_forth(seconds, length) <= length
    step = abs(back_and_forth(seconds + 0.01, length) - back_and_forth(seconds, length))
    assert step <= 0.01 + 1e-9
    assert back_and_forth(0.5 * length, length) == pytest.approx(0.5 * length)
    assert back_and_forth(1.25 * length, length) == pytest.approx(0.75 * length)
    assert back_and_forth(seconds, 0) == 0


def _file(tmp_path, *entries):
    (tmp_path / "path.json").write_text(json.dumps({"cameras": list(entries)}))
    return tmp_path / "path.json"


def test_key_cameras_are_met_and_joined_by_screws(tmp_path):
    keys = read_key_cameras(
        _file(
            tmp_path,
            {"eye": [0, 1, 3], "target": [0, 1, 0]},
            {"eye": [3, 1, 0], "target": [0, 1, 0], "fov_y": 20},
            {"eye": [3, 2, 0], "target": [0, 2, 0], "up": [0, 2, 0], "fov_y": 20},
        ),
        WIDTH,
        HEIGHT,
    )
    assert keys[0].intrinsics[1, 1] == pytest.approx(HEIGHT / 2 / np.tan(np.radians(20)))
    np.testing.assert_allclose(keys[0].world_to_camera, look_at((0, 1, 3), (0, 1, 0)), atol=1e-9)
    cameras = through(keys, 9)
    for key, camera in zip(keys, cameras[::4], strict=True):
        np.testing.assert_allclose(camera.world_to_camera, key.world_to_camera, atol=1e-9)
        np.testing.assert_allclose(camera.intrinsics, key.intrinsics)
    # A quarter turn about the vertical through the target: halfway is an eighth of a turn.
    half = cameras[2].camera_to_world[:3, 3]
    np.testing.assert_allclose(half, (3 / np.sqrt(2), 1, 3 / np.sqrt(2)), atol=1e-9)
    focal = np.sqrt(keys[0].intrinsics[0, 0] * keys[1].intrinsics[0, 0])
    assert cameras[2].intrinsics[0, 0] == pytest.approx(focal)
    np.testing.assert_allclose(cameras[6].camera_to_world[:3, 3], (3, 1.5, 0), atol=1e-9)
    assert len(through(keys[:1], 5)) == 5


@pytest.mark.parametrize(
    "entries",
    [
        [],
        [{"eye": [0, 1], "target": [0, 0, 0]}],
        [{"eye": [0, 0, 0], "target": [0, 0, 0]}],
        [{"eye": [0, 3, 0], "target": [0, 0, 0]}],
        [{"eye": [0, 1, 3]}],
        [{"eye": [0, 1, 3], "target": [0, 0, 0], "fov_y": 200}],
        [{"eye": [0, 1, 3], "target": [0, 0, 0], "fov": 20}],
        [{"eye": [0, 1, "x"], "target": [0, 0, 0]}],
        [7],
        [{"eye": [0, 1, 10**400], "target": [0, 0, 0]}],
        [{"eye": [0, 1, 1e300], "target": [0, 0, 0]}],
        [{"eye": [0, 1, 3], "target": [0, 0, 0], "fov_y": 10**400}],
        [{"eye": [0, 1, 3], "target": [0, 0, 0]}] * 1001,
    ],
)
def test_files_that_are_no_path_are_refused(tmp_path, entries):
    with pytest.raises(SettingsError, match=r"path\.json"):
        read_key_cameras(_file(tmp_path, *entries), WIDTH, HEIGHT)


def test_brackets_without_an_end_are_no_path(tmp_path):
    (tmp_path / "path.json").write_text("[" * 200_000)
    with pytest.raises(
        SettingsError, match=r"path\.json is no camera path \(it is nested too deep"
    ):
        read_key_cameras(tmp_path / "path.json", WIDTH, HEIGHT)


def test_opposite_keys_have_no_way_between(tmp_path):
    looks = [{"eye": [0, 1, z], "target": [0, 1, 0]} for z in (3, -3)]
    with pytest.raises(SettingsError, match="put another between"):
        through(read_key_cameras(_file(tmp_path, *looks), WIDTH, HEIGHT), 4)


def _decoded(path):
    """Pictures, rate and size, as another program sees them."""
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        found = [
            frame.reformat(format="rgb24", src_colorspace="ITU709").to_ndarray()
            for frame in container.decode(stream)
        ]
        return found, float(stream.average_rate), stream.codec_context.name


def test_a_video_holds_the_pictures(tmp_path):
    rows, columns = np.mgrid[:HEIGHT, :WIDTH] / HEIGHT
    shown = [
        (255 * np.stack([rows, columns, np.full_like(rows, k / 10)], -1)).astype(np.uint8)
        for k in range(10)
    ]
    write_video(tmp_path / "v.mp4", iter(shown), (WIDTH, HEIGHT), 29.97)
    found, rate, codec = _decoded(tmp_path / "v.mp4")
    assert (len(found), codec) == (10, "h264")
    assert rate == pytest.approx(29.97, abs=1e-3)
    for a, b in zip(found, shown, strict=True):
        assert a.shape == (HEIGHT, WIDTH, 3)
        assert -10 * np.log10(np.mean((a / 255 - b / 255.0) ** 2)) > 35


def test_a_broken_film_leaves_nothing(tmp_path):
    def broken():
        yield np.zeros((HEIGHT, WIDTH, 3), np.uint8)
        raise RuntimeError

    with pytest.raises(RuntimeError):
        write_video(tmp_path / "v.mp4", broken(), (WIDTH, HEIGHT), 30)
    assert list(tmp_path.iterdir()) == []


def test_a_film_leaves_room_on_the_disk(tmp_path, monkeypatch):
    usage, drawn = shutil.disk_usage(tmp_path), []
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=SPARE + 1 - len(drawn)))

    def endless():
        while True:
            drawn.append(np.zeros((32, 32, 3), np.uint8))
            yield drawn[-1]

    with pytest.raises(StorageError, match=r"a\.mp4 cannot be written, as the disk is full"):
        write_video(tmp_path / "a.mp4", endless(), (32, 32), 25)
    assert len(drawn) == 2 and not list(tmp_path.iterdir())


def test_the_verb_films_a_body(tmp_path, capture, capsys):
    body = still_body(capture, tmp_path / "body")
    size = ("--size", str(WIDTH), str(HEIGHT))
    from ico3d.cli import main

    words = ["render", str(tmp_path / "body"), str(tmp_path / "out.mp4"), *size, "--no-ai-mark"]
    assert main([*words, "--seconds", "0.5", "--fps", "24", "--background", "#0080ff"]) == 0
    found, rate, _ = _decoded(tmp_path / "out.mp4")
    assert (len(found), rate, found[0].shape) == (12, 24.0, (HEIGHT, WIDTH, 3))
    np.testing.assert_allclose(found[0][2, 2], (0, 128, 255), atol=4)
    points = extent(body)
    cameras = orbit(ring_around(points), points, 12, WIDTH, HEIGHT)
    for seen, made in zip(found, pictures(body, cameras, 24, (0, 128 / 255, 1)), strict=True):
        assert -10 * np.log10(np.mean((seen / 255 - made / 255.0) ** 2)) > 25
    assert "12 pictures" in " ".join(capsys.readouterr().out.split())


def test_the_verb_takes_paths_and_captures(tmp_path, capture, monkeypatch):
    open_with(monkeypatch, MovingCapture)
    still_body(capture, tmp_path / "body")
    path = _file(tmp_path, {"eye": [0, 0, 3], "target": [0, 0, 0]})
    for name, arguments in {"a": {"path": str(path)}, "b": {"capture": tmp_path}}.items():
        out = tmp_path / f"{name}.mp4"
        Render(tmp_path / "body", out, size=(32, 48), seconds=0.1, **arguments).run()
        assert len(_decoded(out)[0]) == 3


@pytest.mark.parametrize(
    "arguments",
    [
        {"size": (33, 48)},
        {"seconds": 0.0},
        {"fps": -1.0},
        {"background": "colourful"},
        {"path": "nowhere.json"},
        {"out": Path("film.gif")},
    ],
)
def test_settings_that_make_no_sense_are_refused(tmp_path, capture, arguments):
    still_body(capture, tmp_path / "body")
    given = {"model": tmp_path / "body", "out": tmp_path / "out.mp4"} | arguments
    with pytest.raises(SettingsError):
        Render(**given).run()
    assert not (tmp_path / "out.mp4").exists()


def test_what_is_no_body_is_named(tmp_path):
    with pytest.raises(ModelError, match=r"no model .* a whole person .* a body .* or a bundle"):
        Render(tmp_path, tmp_path / "out.mp4").run()
