"""Expressions that drive an avatar."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from ico3d.common.expression import EYE_NAMES, EyeRange, expression_rows, eye_range

UNIT = st.floats(0, 1, width=32)


def test_a_recording_tells_where_eyes_rest_and_how_far_they_go():
    recorded = np.zeros((11, 7))
    recorded[:, 0] = np.arange(11) / 10
    recorded[:, 1] = 0.3
    recorded[:, 5] = np.arange(11) / 20
    eyes = eye_range(recorded)
    assert eyes.rest == (0.5, 0.3, 0, 0, 0, 0.05, 0)  # the median; of lids a tenth of the way up
    assert eyes.most == (1.0, 0.3, 0, 0, 0, 0.5, 0)
    shown = eyes.values(np.array([[0.0] * 7, [1.0] * 7, [0.5] * 7]))
    np.testing.assert_allclose(
        shown, [eyes.rest, eyes.most, (0.75, 0.3, 0, 0, 0, 0.275, 0)], atol=1e-7
    )


@given(arrays(np.float32, (5, 7), elements=UNIT), arrays(np.float32, (3, 7), elements=UNIT))
def test_nothing_goes_beyond_what_was_recorded(recorded, shares):
    shown = eye_range(recorded).values(shares)
    assert (shown <= recorded.max(0) + 1e-6).all() and (shown >= recorded.min(0) - 1e-6).all()


def test_without_a_recording_values_are_what_they_say():
    values = np.random.default_rng(0).uniform(size=(4, len(EYE_NAMES))).astype(np.float32)
    np.testing.assert_array_equal(EyeRange().values(values), values)


def test_rows_keep_the_resting_face_where_nothing_moves():
    idle = np.arange(41, dtype=np.float32)
    lips, eyes = np.full((2, 32), -1.0), np.full((2, 7), -2.0)
    rows = expression_rows(idle, lips, eyes, 32)
    assert (rows[:, :32] == -1).all() and (rows[:, 32:39] == -2).all()
    assert (rows[:, 39:] == idle[39:]).all()
    assert (expression_rows(idle, lips[:, :0], eyes, None) == idle).all()
