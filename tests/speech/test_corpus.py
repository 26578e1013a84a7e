import numpy as np
import pytest

from ico3d.speech.training import corpus
from ico3d.speech.training.augment import recorded
from ico3d.speech.training.corpus import make_batch

pytestmark = pytest.mark.slow

pytest.importorskip("espeakng_loader")


def test_a_batch_is_labelled_at_every_window_and_repeats_with_its_seed():
    batch = make_batch(np.random.default_rng(1), 4, 2.0, held_out=False)
    assert batch.mel.shape == (4, 80, 161) and batch.mel.dtype == np.float32
    assert batch.visemes.shape == (4, 146) and batch.articulation.shape == (4, 146, 5)
    assert len(np.unique(batch.visemes)) > 6
    again = make_batch(np.random.default_rng(1), 4, 2.0, held_out=False)
    np.testing.assert_array_equal(batch.mel, again.mel)
    np.testing.assert_array_equal(batch.visemes, again.visemes)
    other = make_batch(np.random.default_rng(2), 4, 2.0, held_out=False)
    assert not np.array_equal(batch.mel, other.mel)


def test_what_is_held_out_is_not_trained_on():
    assert not set(corpus.LANGUAGES) & set(corpus.HELD_OUT_LANGUAGES)
    assert not set(corpus.VARIANTS) & set(corpus.HELD_OUT_VARIANTS)
    trained, kept = set(corpus._words(False)), set(corpus._words(True))
    assert not trained & kept and len(trained) > 800 and len(kept) > 100


@pytest.mark.parametrize("voices", ["VARIANTS", "HELD_OUT_VARIANTS"])
def test_every_voice_is_there(voices):
    default = corpus.synthesize("hello", "en-us").samples
    for variant in getattr(corpus, voices):
        assert not np.array_equal(corpus.synthesize("hello", f"en-us+{variant}").samples, default)


def test_every_language_is_there():
    for language in (*corpus.LANGUAGES, *corpus.HELD_OUT_LANGUAGES):
        assert len(corpus.synthesize("hello", language).samples) > 2000


def test_labels_are_in_time_with_the_sound():
    """Speech is louder where a vowel is said than where nothing is."""
    loud, quiet = [], []
    for seed in range(4):
        batch = make_batch(np.random.default_rng(seed), 4, 2.0, held_out=False)
        middle = batch.mel[:, :, 7:-8].mean(1)  # (4, 146) the row at the label's time
        loud += list(middle[batch.articulation[:, :, 0] > 0.8])
        quiet += list(middle[batch.visemes == 0])
    assert np.mean(loud) > np.mean(quiet) + 0.5


def test_a_recording_keeps_its_timing():
    click = np.zeros(16000)
    click[8000] = 1.0
    for seed in range(10):
        heard = recorded(click, np.zeros(10), np.random.default_rng(seed))
        assert heard.shape == (16000,) and heard.dtype == np.float32
        assert np.abs(heard).max() <= 1
        assert abs(int(np.abs(heard).argmax()) - 8000) < 80  # 5 ms


def test_recordings_of_silence_are_finite():
    for seed in range(5):
        heard = recorded(np.zeros(1600), np.zeros(10), np.random.default_rng(seed))
        assert np.isfinite(heard).all()
