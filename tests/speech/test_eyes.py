import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from ico3d.common.expression import EYE_NAMES
from ico3d.speech.eyes import EyeBehaviour, smooth_eyes

LEFT, RIGHT = EYE_NAMES.index("eyeBlinkLeft"), EYE_NAMES.index("eyeBlinkRight")


@given(st.integers(5, 40), st.integers(0, 1000))
def test_smoothing_is_savitzky_golay(count, seed):
    from scipy.signal import savgol_filter

    values = np.random.default_rng(seed).uniform(0, 1, (count, 7))
    np.testing.assert_allclose(smooth_eyes(values), savgol_filter(values, 5, 3, axis=0), atol=1e-12)


def test_smoothing_keeps_cubics_and_short_tracks():
    t = np.linspace(-1, 1, 20)[:, None]
    cubic = 2 * t**3 - t**2 + 0.5 * t + 1
    np.testing.assert_allclose(smooth_eyes(cubic), cubic, atol=1e-12)
    short = np.arange(8.0).reshape(4, 2)
    np.testing.assert_array_equal(smooth_eyes(short), short)


def test_behaviour_depends_on_seed_and_time_only():
    times = np.arange(0, 60, 1 / 25)
    whole = EyeBehaviour(7).values(times)
    assert whole.shape == (1500, 7) and whole.dtype == np.float32
    pieces = EyeBehaviour(7)
    late = pieces.values(times[1000:])
    early = pieces.values(times[:1000])
    np.testing.assert_array_equal(np.concatenate([early, late]), whole)
    np.testing.assert_array_equal(EyeBehaviour(7).values(np.arange(0, 60, 1 / 50))[::2], whole)
    assert not np.array_equal(EyeBehaviour(8).values(times), whole)


def test_blinks_are_human():
    eyes = EyeBehaviour(0)
    starts = eyes.blink_times(3000)
    pauses = np.diff(starts)
    assert pauses.min() >= 2 - 1e-9 and pauses.max() <= 6 + 1e-9
    assert 3 < pauses.mean() < 4.2 and pauses.std() > 0.6
    times = np.arange(0, 600, 0.001)
    values = eyes.values(times)
    np.testing.assert_array_equal(values[:, LEFT], values[:, RIGHT])
    for start in starts[starts < 590][:20]:
        blink = values[(times >= start - 0.001) & (times <= start + 0.25), LEFT]
        assert blink.max() > 0.999
        assert 0.15 <= np.count_nonzero(blink > 0.01) * 0.001 <= 0.2
        assert np.abs(np.diff(blink)).max() < 0.03  # no jumps
    assert (values[:, LEFT] == 0).mean() > 0.9


def test_brows_move_slowly_and_little():
    values = EyeBehaviour(1).values(np.arange(0, 100, 0.04))
    brows = values[:, [i for i, name in enumerate(EYE_NAMES) if name.startswith("brow")]]
    assert brows.min() >= 0 and brows.max() <= 0.11
    assert brows.std(0).min() > 0.003
    assert np.abs(np.diff(brows, axis=0)).max() < 0.01


def test_no_times_no_values():
    assert EyeBehaviour(0).values(np.zeros(0)).shape == (0, 7)
