import contextlib
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from ico3d.common.espeak.process import process
from ico3d.common.espeak.speech import synthesize
from ico3d.common.native import isolated
from ico3d.errors import ServiceError, SettingsError

pytest.importorskip("espeakng_loader")


def loudness(speech, start, end):
    stretch = speech.samples[int(start * speech.rate) : int(end * speech.rate)]
    return float(np.sqrt(np.mean(stretch**2)))


def spans(speech):
    ends = [event.time for event in speech.events[1:]] + [len(speech.samples) / speech.rate]
    return [(event.symbol, event.time, end) for event, end in zip(speech.events, ends, strict=True)]


def test_samples_and_phonemes_cover_the_text():
    speech = synthesize("Hello world.")
    assert speech.rate == 22050
    assert speech.samples.dtype == np.float32
    assert 0.05 < np.abs(speech.samples).max() <= 1
    assert " ".join(e.symbol for e in speech.events if e.symbol) == "h ə l ˈoʊ w ˈɜː l d"
    times = [e.time for e in speech.events]
    assert times == sorted(times)
    assert times[0] >= 0 and times[-1] <= len(speech.samples) / speech.rate


@pytest.mark.parametrize("voice", ["en-us", "en-us+f3", "en-us+klatt2", "it"])
def test_a_voiceless_stop_begins_with_its_silent_closure(voice):
    speech = synthesize("a papa papa", voice)
    stops = [(start, end) for symbol, start, end in spans(speech) if symbol == "p"]
    assert len(stops) == 4
    loudest = float(np.abs(speech.samples).max())
    for start, end in stops:
        assert 0.05 < end - start < 0.15
        assert loudness(speech, start, start + 0.03) < 0.04 * loudest
        assert loudness(speech, start - 0.03, start) > 0.04 * loudest


def test_a_pause_is_an_event_without_symbol_and_silent():
    speech = synthesize("One. Two.")
    pauses = [
        (start, end) for symbol, start, end in spans(speech)[:-2] if not symbol and end > start
    ]
    start, end = max(pauses, key=lambda span: span[1] - span[0])
    assert end - start > 0.1
    assert loudness(speech, start + 0.02, end) < 1e-3


def test_rate_and_pitch_change_the_sound():
    slow, fast = synthesize("Good morning.", rate=120), synthesize("Good morning.", rate=240)
    assert len(fast.samples) < 0.75 * len(slow.samples)
    low, high = synthesize("ah", pitch=10), synthesize("ah", pitch=90)
    crossings = [np.count_nonzero(np.diff(np.signbit(s.samples))) for s in (low, high)]
    assert not np.array_equal(low.samples, high.samples) and crossings[0] != crossings[1]


def test_nothing_to_say_is_no_error():
    assert len([e for e in synthesize("").events if e.symbol]) == 0


def test_threads_get_their_own_text_and_repeat_it_exactly():
    texts = ["one", "two three four", "papa", "a long sentence about the weather"]
    alone = [synthesize(text) for text in texts]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(synthesize, texts * 5))
    for expected, found in zip(alone * 5, together, strict=True):
        assert found.events == expected.events
        np.testing.assert_array_equal(found.samples, expected.samples)


@pytest.mark.parametrize("voice", ["xx-nowhere", "file", "!v/f3", "../file", "en-us+../../file"])
def test_an_unknown_voice_is_one_sentence(voice, tmp_path, monkeypatch):
    """Nor is a file of that name read, which the library would obey."""
    (tmp_path / "file").write_text("language en\nspeed 450\nphonemes de\n")
    monkeypatch.chdir(tmp_path)
    process.close()  # which ran elsewhere
    with pytest.raises(SettingsError, match="no voice"):
        synthesize("hello", voice)
    with pytest.raises(SettingsError, match="no voice"):
        synthesize("hello", str(tmp_path / voice))
    process.close()


def test_a_missing_package_names_its_extra():
    code = (
        "import sys; sys.modules['espeakng_loader'] = None\n"
        "from ico3d.common.espeak.speech import synthesize\n"
        "from ico3d.errors import MissingExtraError\n"
        "try: synthesize('hello')\n"
        "except MissingExtraError as error: print(error)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "ico3d[voice]" in done.stdout


def test_a_process_that_ends_is_followed_by_another():
    before = synthesize("Good morning.")
    assert process._process is not None
    process._process.kill()
    with pytest.raises(ServiceError, match="failed at a text"):
        synthesize("Good morning.")
    np.testing.assert_array_equal(synthesize("Good morning.").samples, before.samples)


def test_a_text_that_breaks_the_library_ends_no_process_but_its_own():
    with contextlib.suppress(ServiceError):  # some versions of the library can speak it
        synthesize("'s" * 90)
    assert len(synthesize("Good morning.").samples) > 1000


def test_a_text_without_an_end_is_given_up(monkeypatch):
    synthesize("Good morning.")
    monkeypatch.setattr(process, "longest", 0.05)
    with pytest.raises(ServiceError, match="failed at a text"):
        synthesize("a long sentence " * 3000)
    monkeypatch.undo()
    assert len(synthesize("Good morning.").samples) > 1000


def test_whoever_stops_in_the_middle_leaves_no_half_answer(monkeypatch):
    before = synthesize("One.")
    read = isolated._read

    def stop(pipe, count):
        read(pipe, count)
        raise KeyboardInterrupt

    monkeypatch.setattr(isolated, "_read", stop)
    with pytest.raises(KeyboardInterrupt):
        synthesize("A longer sentence.")
    monkeypatch.undo()
    np.testing.assert_array_equal(synthesize("One.").samples, before.samples)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="forks")
def test_a_fork_speaks_by_a_process_of_its_own():
    before = synthesize("One.")
    child = os.fork()
    if child == 0:
        same = np.array_equal(synthesize("One.").samples, before.samples)
        process.close()
        os._exit(0 if same else 1)
    assert os.waitpid(child, 0)[1] == 0
    np.testing.assert_array_equal(synthesize("One.").samples, before.samples)


def test_a_process_that_ends_leaves_no_files_behind():
    synthesize("One.")
    folder = Path(process._folder)
    assert folder.is_dir()
    assert process._process is not None
    (folder / "copy").write_bytes(b"of the library")
    process._process.kill()
    with pytest.raises(ServiceError):
        synthesize("Two.")
    assert not folder.exists()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="forks")
def test_a_fork_while_a_thread_asks_waits_for_nobody():
    """A program that the event loop starts is such a fork, and the loop waits for it."""
    synthesize("One.")
    with ThreadPoolExecutor(1) as pool:
        asked = pool.submit(synthesize, "a long sentence about the weather " * 300)
        time.sleep(0.1)  # by now it waits for the sound
        child = os.fork()
        if child == 0:
            os._exit(0)
        assert not asked.done()
        until = time.monotonic() + 10
        while not (ended := os.waitpid(child, os.WNOHANG)[0]) and time.monotonic() < until:
            time.sleep(0.01)
        if not ended:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
        assert ended and len(asked.result().samples) > 22050
