"""How a head is turned, as a part of what drives it."""

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from ico3d.head.expressions import LEAST_TURN, TURN_WEIGHT, turn_of
from ico3d.head.model_folder import TrainedHead
from ico3d.head.settings import PRESETS
from ico3d.head.train_head import HeadJob, train_head
from ico3d.head.views import view_of
from ico3d.measure.head import HeadRenderer
from ico3d.splat.render import render
from support.heads.tiny_capture import TinyCapture
from support.settings import changed


class Nodding(TinyCapture):
    """A capture of a head that nods by 0.2 radians to either side of a slant."""

    def _pose(self, frame):
        pose = super()._pose(frame)
        angle = 0.2 * np.sin(np.pi / 2 * frame)
        slant = Rotation.from_rotvec([0, 0.5, 0])
        pose[:3, :3] = (Rotation.from_rotvec([angle, 0, 0]) * slant).as_matrix()
        return pose


def test_values_are_shares_of_the_largest_angle_and_end_there(tmp_path):
    capture = Nodding(tmp_path)
    turn = turn_of(capture, range(40))
    np.testing.assert_allclose(turn.most, [0.2, 0, 0], atol=1e-5)

    def values(angle, axis=0):
        extra = Rotation.from_rotvec(angle * np.eye(3)[axis])
        return turn.values((extra * Rotation.from_rotvec([0, 0.5, 0])).as_matrix())

    np.testing.assert_allclose(values(0.1), [TURN_WEIGHT / 2, 0, 0], atol=1e-5)
    np.testing.assert_allclose(values(-0.7), [-TURN_WEIGHT, 0, 0], atol=1e-5)
    half = values(LEAST_TURN / 2, axis=2)  # about an axis about which it was not seen to turn
    np.testing.assert_allclose(half, [0, 0, TURN_WEIGHT / 2], atol=1e-3)


@pytest.mark.slow
def test_a_trained_head_follows_its_rotation_in_pictures_alone(tmp_path):
    capture = Nodding(tmp_path / "capture")
    settings = changed(PRESETS["cpu"], {"steps": 12, "initial.gaussians": 60})
    job = HeadJob("blendshapes", "full", "builtin", 0, settings)
    head = train_head(capture, tmp_path / "head", job)
    loaded = TrainedHead.load(tmp_path / "head")
    assert head.turn is not None and loaded.turn == head.turn
    expression = loaded.track(capture).at(1)
    assert expression.shape == (3,)  # avatars and bundles drive it as any other head
    view = view_of(capture, 0, 1)
    drawn = HeadRenderer(loaded, capture).picture(view, torch.zeros(3))
    turned = torch.cat([expression, torch.tensor([TURN_WEIGHT, 0.0, 0.0])])

    def rendered(values):
        with torch.no_grad():
            picture = render(loaded.model(values), [view.camera], torch.zeros(3)).rgb[0]
        return picture.clamp(0, 1).numpy()

    np.testing.assert_allclose(drawn, rendered(turned), atol=1e-6)
    assert np.abs(drawn - rendered(expression)).max() > 1e-4
