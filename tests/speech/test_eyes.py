import numpy as np

from ico3d.common.expression import EYE_NAMES
from ico3d.speech.eyes import EyeBehaviour

LEFT, RIGHT = EYE_NAMES.index("eyeBlinkLeft"), EYE_NAMES.index("eyeBlinkRight")


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
