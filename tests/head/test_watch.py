"""Watching a head in training, as a browser does: over HTTP and viser's WebSocket."""

import socket
import sys
import threading
import time
import urllib.request
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
import pytest
import torch
from safetensors.torch import load_file

from ico3d.common.expression import EYE_NAMES
from ico3d.errors import MissingExtraError
from ico3d.head.expressions import BlendshapeTrack, SpeechTrack
from ico3d.head.model import HeadModel
from ico3d.head.optimise import HeadTrainer
from ico3d.head.settings import PRESETS
from ico3d.head.train_head import HeadJob, train_head
from ico3d.head.watch import WatchedHead, live_page
from ico3d.speech.network import SpeechAdaptor
from ico3d.training.watch import RADIUS, LivePage
from support.heads.shapes import head_shape
from support.needs import needs
from support.settings import changed

pytestmark = needs("viser")

SETTINGS = changed(
    PRESETS["cpu"],
    {"steps": 60, "initial.gaussians": 200, "density.begin": 100, "checkpoint_every": 25},
)
JOB = HeadJob("blendshapes", "full", "builtin", 0, SETTINGS)


class Browser:
    """Looks at a page and moves what is on it."""

    def __init__(self, port: int):
        import viser
        from websockets.sync.client import connect

        self.html = urllib.request.urlopen(f"http://127.0.0.1:{port}", timeout=20).read()
        protocol = f"viser-v{viser.__version__}"
        self._socket = connect(
            f"ws://127.0.0.1:{port}", subprotocols=[protocol], max_size=None, ping_interval=None
        )
        self._reader = threading.Thread(target=lambda: list(self._socket))  # until it is closed
        self._reader.start()
        self._send(
            "ViewerCameraMessage",
            wxyz=[1, 0, 0, 0],
            position=[0, 0, 1],
            fov=1.0,
            near=0.1,
            far=100.0,
            image_height=100,
            image_width=100,
            look_at=[0, 0, 0],
            up_direction=[0, 1, 0],
        )

    def move(self, handle, value) -> None:
        """Moves a slider, or presses a button (value True)."""
        self._send("GuiUpdateMessage", uuid=handle._impl.uuid, updates={"value": value})

    def ask_to_share(self) -> None:
        """What the button does that the page does not show."""
        self._send("ShareUrlRequest")

    def close(self) -> None:
        self._socket.close()
        self._reader.join()

    def _send(self, kind: str, **fields) -> None:
        import msgspec

        self._socket.send(msgspec.msgpack.encode({"type": kind, **fields}))


def _await(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 20
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.005)


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.fixture(scope="module")
def head(tmp_path_factory):
    """A capture, and a head that has learnt from it."""
    from support.heads.tiny_capture import TinyCapture

    tiny = TinyCapture(tmp_path_factory.mktemp("watch"))
    return tiny, train_head(tiny, tiny.path / "model", JOB)


@pytest.fixture
def page(head) -> Iterator[LivePage]:
    tiny, trained = head
    track = BlendshapeTrack(tiny, tiny.blendshape_names)
    with LivePage(_watched(tiny, trained.model, track), _free_port()) as page:
        yield page


def _watched(capture, model, track) -> WatchedHead:
    """A head that is about to learn from a capture."""
    return WatchedHead(HeadTrainer(capture, model, track, None, SETTINGS, 0))


@pytest.fixture
def browser(page) -> Iterator[Browser]:
    browser = Browser(page.server.get_port())
    _await(lambda: bool(page.server.get_clients()))
    yield browser
    browser.close()


def _step(page: LivePage, until: Callable[[], bool]) -> None:
    """What the training thread does between steps, as often as it takes."""
    _await(lambda: page.after_step(3, {"loss": 0.25}) or until())


def test_a_moved_slider_changes_the_gaussians(page, browser, head):
    tiny, trained = head
    assert b"<html" in browser.html.lower()
    assert list(page._sliders) == ["pale", "redden"]  # "unused" never moves
    _step(page, lambda: "| 3 | 0.25 |" in page._numbers.content)
    before, shown = page._splats.rgbs.copy(), page._pictures.image
    browser.move(page._sliders["redden"], 1.0)
    _step(page, lambda: not np.array_equal(page._splats.rgbs, before))
    expression = torch.tensor([1.0, tiny.blendshapes(0)[1], 0.0])
    colors = trained.model(expression).colors.detach().numpy()
    np.testing.assert_allclose(page._splats.rgbs, 255 * colors, atol=1.01)
    assert np.array_equal(page._pictures.image, shown)  # pictures keep to what was recorded


def test_nobody_can_have_the_page_shared(page, browser):
    browser.ask_to_share()
    browser.move(page._frame, 3)
    _step(page, lambda: page._frame_shown == 3)  # by now the other is answered, too
    assert page.server._share_tunnel is None


def test_a_moved_frame_changes_sliders_and_pictures(page, browser, head):
    tiny, _ = head
    browser.move(page._frame, 7)
    _step(page, lambda: page._frame_shown == 7)
    redden = page._sliders["redden"].value
    assert redden == pytest.approx(tiny.blendshapes(7)[0], abs=6e-4)
    recorded = page._pictures.image[:, :48] / 255
    assert np.abs(recorded - tiny.image(1, 7)).max() < 0.01
    rendered = page._pictures.image[:, 48:] / 255
    assert 1e-6 < ((rendered - recorded) ** 2).mean() < 0.01


def test_pause_holds_the_training_thread_until_resume(page, browser):
    browser.move(page._button, True)
    _await(lambda: page._button.label == "Resume")
    training = threading.Thread(target=page.after_step, args=(4, {"loss": 0.5}))
    training.start()
    browser.move(page._frame, 5)
    _await(lambda: page._frame_shown == 5)  # one can look around meanwhile
    assert training.is_alive()
    browser.move(page._button, True)
    training.join(5)
    assert not training.is_alive()


def test_the_scene_is_upright_and_of_its_size(page, head):
    _, trained = head
    distances = np.linalg.norm(page._splats.centers - page._scale * page._center, axis=1)
    assert np.quantile(distances, 0.9) == pytest.approx(RADIUS, rel=1e-3)
    scales = page._scale * trained.model.log_scales.detach().exp().numpy()
    traces = np.trace(page._splats.covariances, axis1=1, axis2=2)
    np.testing.assert_allclose(traces, (scales**2).sum(1), rtol=5e-3)
    view = page.server.initial_camera
    np.testing.assert_allclose(view.position / page._scale, [0, 0, 1], atol=0.03)
    assert view.fov == pytest.approx(2 * np.arctan(24 / 60))


def test_sliders_are_for_named_inputs_that_do_something(head):
    tiny, _ = head
    speech = SpeechTrack(tiny, np.zeros((40, 64), np.float32), SpeechAdaptor(64))
    driven = HeadModel(head_shape(speech.size), 5)
    subject = _watched(tiny, driven, speech)
    assert {slider.name for slider in subject.sliders} == set(EYE_NAMES)
    assert all((slider.low, slider.high) == (0, 0.2) for slider in subject.sliders)
    static = HeadModel(head_shape(3, "static"), 5)
    track = BlendshapeTrack(tiny, tiny.blendshape_names)
    assert _watched(tiny, static, track).sliders == []


def test_only_frames_that_are_learnt_from_are_shown(head, monkeypatch):
    """By the first camera that recorded them; what it looks at there is that picture."""
    tiny, trained = head
    whole, asked = type(tiny).image, []

    def image(self, camera, frame):
        asked.append((camera, frame))
        return None if frame == 2 else whole(self, camera, frame)

    monkeypatch.setattr(type(tiny), "image", image)
    track = BlendshapeTrack(tiny, tiny.blendshape_names)
    watched = _watched(tiny, trained.model, track)
    assert watched.frames == len(tiny.split.train) - 1
    pose = tiny.world_from_head(3)
    seen = tiny.cameras[1].moved(pose).world_to_camera
    np.testing.assert_array_equal(watched.camera(2).world_to_camera, seen)
    assert watched.values(2) == dict(zip(track.names, tiny.blendshapes(3), strict=True))
    recorded, _ = watched.pictures(2)
    assert np.abs(recorded.numpy() - whole(tiny, 1, 3)).max() < 0.01
    before = len(asked)
    watched.pictures(2)
    assert len(asked) == before  # what training and watching read is kept for both


def test_watching_changes_nothing_of_what_is_learnt(head, tmp_path):
    tiny, trained = head
    port = _free_port()
    watching = threading.Thread(target=_watch_once, args=(port,))
    watching.start()
    train_head(tiny, tmp_path / "model", JOB, partial(live_page, port=port))
    watching.join()
    for name, tensor in load_file(tmp_path / "model" / "model.safetensors").items():
        assert torch.equal(tensor, trained.model.state_dict()[name]), name


def _watch_once(port: int) -> None:
    def connected() -> bool:
        try:
            browsers.append(Browser(port))
        except OSError:
            return False
        return True

    browsers: list[Browser] = []
    _await(connected)
    time.sleep(0.3)
    browsers[0].close()


def test_without_viser_one_is_told_what_to_install(tiny, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(MissingExtraError, match=r"'viser'.*ico3d\[watch\]"):
        train_head(tiny, tmp_path / "model", JOB, partial(live_page, port=0))
