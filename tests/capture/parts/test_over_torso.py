"""A portrait's head alone, over the recorded torso."""

import numpy as np
import pytest
import torch

from ico3d.capture.formats import open_capture
from ico3d.capture.importing.resized import ResizedCapture
from ico3d.capture.parts.over_torso import HeadOverTorso
from ico3d.errors import CaptureError
from ico3d.head.views import PictureCache, staged, view_of
from ico3d.studio.layouts.portrait import write_portrait
from support.heads.tiny_capture import TinyCapture
from support.heads.tiny_talker import HEIGHT, TinyTalker


@pytest.fixture(scope="module")
def portrait(tmp_path_factory):
    """A talking portrait with shoulders."""
    folder = tmp_path_factory.mktemp("torso")
    return open_capture(write_portrait(TinyTalker(folder / "talker"), folder / "written"))


def test_what_is_behind_the_head_is_the_frame_without_it(portrait):
    over = HeadOverTorso(portrait)
    behind, image = over.behind(0, 5), portrait.image(0, 5)
    beside = portrait.head_mask(0, 5) == 0
    assert np.abs(behind - image)[beside].mean() < 0.03  # JPEG, and soft edges
    np.testing.assert_allclose(behind[HEIGHT // 2, HEIGHT // 2], 0.5, atol=0.01)  # the plate
    np.testing.assert_array_equal(over.mask(0, 5), portrait.head_mask(0, 5))
    np.testing.assert_array_equal(over.mask_bytes(0, 5), portrait.head_mask_bytes(0, 5))


def test_training_draws_over_it(portrait):
    over = HeadOverTorso(portrait)
    cache, view = PictureCache(over, 0.1), view_of(over, 0, 5)
    picture = cache.picture(view, torch.device("cpu"))
    behind, target = staged(picture, cache.background(view, torch.device("cpu")))
    np.testing.assert_allclose(behind, over.behind(0, 5), atol=0.5 / 255 + 1e-6)
    np.testing.assert_allclose(target, portrait.image(0, 5), atol=1e-6)
    assert picture.torso is None and float(picture.mask[-8:].max()) == 0


def test_smaller_pictures_have_smaller_torsos(portrait):
    small = HeadOverTorso(ResizedCapture(portrait, HEIGHT // 2))
    assert small.behind(0, 5).shape == (HEIGHT // 2, HEIGHT // 2, 3)


def test_a_capture_without_torso_is_named(tmp_path):
    with pytest.raises(CaptureError, match="no portrait with a clean plate"):
        HeadOverTorso(TinyCapture(tmp_path))
