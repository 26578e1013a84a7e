"""Eyes mirror a lamp: white, on the cornea, hidden by lids and by nothing else."""

import numpy as np
import pytest

from ico3d.avatar.baking.eyes.catchlights import APEX, CORNEA, LAMP, SHUT, with_catchlights
from ico3d.avatar.baking.eyes.eyeballs import Eyeball, turned_by_gaze
from ico3d.bundle.evaluate import attributes, centres
from ico3d.bundle.format import Bundle
from ico3d.bundle.head import BakedHead, no_displacements
from ico3d.bundle.packaged import NAME, bundle_path
from ico3d.common.expression import LIDS, SPEECH_SIZE

SIZE = SPEECH_SIZE + 7
IDLE = np.zeros(SIZE, np.float32)
LIFTED = [SPEECH_SIZE + lid for lid in LIDS]
EYES = np.array([[-0.03, 0.0, 0.05], [0.03, 0.0, 0.05]])


def closed(by: float) -> np.ndarray:
    expression = IDLE.copy()
    expression[LIFTED] = by
    return expression


def head_of(count: int = 20) -> BakedHead:
    """A head whose coefficients follow speech, lids, and both; grey, and nowhere near the eyes."""
    rng = np.random.default_rng(0)
    w1 = np.zeros((SIZE, 4), np.float32)
    w1[:SPEECH_SIZE, :2] = rng.normal(size=(SPEECH_SIZE, 2)) / 8
    w1[LIFTED, 2:] = 1.0
    return BakedHead(
        means=rng.normal(size=(count, 3)).astype(np.float32),
        quats=np.tile(np.float16([1, 0, 0, 0]), (count, 1)),
        scales=np.full((count, 3), -6, np.float16),
        mean_logits=np.zeros((count, 4), np.float16),
        basis=rng.integers(-127, 127, (3, count, 4)).astype(np.int8),
        basis_scale=np.full(count, 0.01, np.float32),
        **no_displacements(count, SIZE),
        w1=w1,
        b1=np.full(4, 2.0, np.float32),  # above the bend of its hidden units
        w2=np.float32([[1, 0, 0.1], [0.5, 0, 0], [0, 1, 0], [0, 0.5, 0.4]]),
        b2=np.float32([0.3, -0.2, 0.5]),
    )


def lit(head: BakedHead, shut: np.ndarray) -> tuple[BakedHead, list[Eyeball]]:
    balls = [Eyeball(eye, np.zeros(head.num_gaussians, bool)) for eye in EYES]
    return with_catchlights(head, balls, IDLE, shut)


def test_each_eye_has_one_where_its_cornea_mirrors_the_lamp():
    head = head_of()
    made, balls = lit(head, closed(SHUT))
    assert made.num_gaussians == 22
    assert [ball.own.nonzero()[0].tolist() for ball in balls] == [[0], [1]]
    normals = (made.means[:2] - EYES - (0, 0, APEX - CORNEA)) / CORNEA
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-5)
    for normal in normals:  # as far from the lamp as from the visitor, and between them
        towards = np.array(LAMP) / np.linalg.norm(LAMP)
        assert normal @ towards == pytest.approx(normal[2], abs=1e-5)
        np.testing.assert_allclose(np.cross(towards, (0, 0, 1)) @ normal, 0, atol=1e-5)
    for name in ("means", "scales", "mean_logits", "basis_scale"):
        np.testing.assert_array_equal(getattr(made, name)[2:], getattr(head, name))
    np.testing.assert_array_equal(made.basis[:, 2:], head.basis)


def test_it_turns_with_its_eye():
    made, balls = lit(head_of(), closed(SHUT))
    turning, _ = turned_by_gaze(made, balls)
    arm = made.means[0] - EYES[0]
    by = (centres(turning, IDLE, (0.1, 0.0)) - made.means)[:2]
    np.testing.assert_allclose(by, np.tile([0.1 * arm[2], 0, -0.1 * arm[0]], (2, 1)), atol=1e-5)


def test_lids_hide_it_and_speech_does_not():
    made, _ = lit(head_of(), closed(SHUT))
    colours, seen = attributes(made, IDLE)
    assert (colours[:2] > 0.95).all() and (seen[:2] > 0.95).all()
    assert (attributes(made, closed(SHUT))[1][:2] < 0.01).all()
    assert (attributes(made, closed(SHUT / 2))[1][:2] < 0.5).all()
    talking = np.random.default_rng(1).normal(size=(50, SIZE)).astype(np.float32)
    talking[:, SPEECH_SIZE:] = 0
    told = [attributes(made, row)[1][0] for row in talking]
    assert min(told) > 0.9 and max(told) < 0.999


def test_it_stays_where_nothing_drives_the_lids():
    made, _ = lit(head_of(), IDLE)
    for expression in (IDLE, closed(1.0)):
        assert (attributes(made, expression)[1][:2] > 0.95).all()


def test_the_packaged_person_has_light_in_both_eyes():
    bundle = Bundle.open(bundle_path(NAME))
    head, info = bundle.require_head()[0], bundle.manifest.head
    assert info is not None
    few = head.chosen(np.arange(2))
    idle = np.array(info.idle_expression, np.float32)
    colours, seen = attributes(few, idle)
    assert (colours > 0.9).all() and (seen > 0.9).all()
    assert few.means[0, 0] < -0.02 and few.means[1, 0] > 0.02
    idle[LIFTED] = 0.8
    assert (attributes(few, idle)[1] < 0.02).all()
