"""Sound files are judged by what they claim before they are decoded or resampled."""

import tracemalloc
import wave

import av
import numpy as np
import pytest
import soundfile
import soxr

from ico3d.capture.sound import BLOCK, RATE, read_sound_file
from ico3d.capture.synthetic import SyntheticCapture
from ico3d.capture.video import read_sound
from ico3d.common.sound import RECORDING, Claim, fault
from ico3d.errors import CaptureError
from support.recordings.films import write_heard

MB = 1 << 20


def refused(read, match):
    """Asks that `read` refuses what it is given, without much memory."""

    def ask():
        with pytest.raises(CaptureError, match=match):
            read()

    assert memory_of(ask) < 10 * MB


def memory_of(read):
    """Bytes that a reader takes at most."""
    tracemalloc.start()
    try:
        read()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def noise(count):
    """(S,) int16."""
    return np.random.default_rng(0).integers(-9000, 9000, count, np.int16)


@pytest.mark.parametrize("rate", [1, 1000])
def test_two_kilobytes_are_no_half_hour(tmp_path, rate):
    path = tmp_path / "a.wav"
    soundfile.write(path, np.zeros(1000), rate)
    refused(lambda: read_sound_file(path), f"claims {rate} samples per second")


def test_raw_sound_is_refused_in_a_sentence(tmp_path):
    path = tmp_path / "a.raw"
    path.write_bytes(bytes(2000))
    refused(lambda: read_sound_file(path), "cannot be read")


def test_a_flac_file_that_claims_days_is_not_decoded(tmp_path):
    path = tmp_path / "a.flac"
    soundfile.write(path, np.zeros(4000), 16_000)
    data = bytearray(path.read_bytes())
    low = int.from_bytes(data[18:26], "big") | (1 << 36) - 1  # the 36 bits of its length
    data[18:26] = low.to_bytes(8, "big")
    path.write_bytes(data)
    refused(lambda: read_sound_file(path), "is longer than 7200 s")


@pytest.mark.parametrize("rate", [8000, 11_025, 44_100, 192_000])
def test_every_usual_rate_is_taken(tmp_path, rate):
    path = tmp_path / "a.wav"
    soundfile.write(path, np.zeros((rate, 2)), rate)
    assert len(read_sound_file(path).samples) == RATE


def test_a_video_whose_sound_claims_a_strange_rate(tmp_path):
    path = tmp_path / "a.mov"
    with av.open(str(path), "w") as out:
        stream = out.add_stream("pcm_s16le", rate=50, layout="mono")
        picture = out.add_stream("mpeg4", rate=25)
        picture.width = picture.height = 16
        for _ in range(3):
            out.mux(picture.encode(av.VideoFrame(16, 16, "yuv420p")))
        frame = av.AudioFrame.from_ndarray(np.zeros((1, 2000), np.int16), "s16", "mono")
        frame.sample_rate = 50
        for packet in [*stream.encode(frame), *stream.encode(), *picture.encode()]:
            out.mux(packet)
    refused(lambda: read_sound(path), "claims 50 samples per second")


def test_a_film_is_resampled_piece_by_piece_as_it_would_be_at_once(tmp_path):
    samples = noise(100_000)
    sound = read_sound(write_heard(tmp_path / "a.mkv", samples, 48_000))
    whole = soxr.resample(samples / np.float32(1 << 15), 48_000, RATE, quality="VHQ")
    np.testing.assert_allclose(sound.samples, whole, atol=1e-6)
    assert sound.samples.dtype == np.float32


def test_a_sound_file_is_resampled_block_by_block_as_it_would_be_at_once(tmp_path):
    samples = noise(5 * BLOCK + 98).reshape(-1, 2)
    soundfile.write(tmp_path / "a.flac", samples, 44_100)
    sound = read_sound_file(tmp_path / "a.flac")
    mean = (samples / np.float32(1 << 15)).mean(1)
    np.testing.assert_allclose(
        sound.samples, soxr.resample(mean, 44_100, RATE, quality="VHQ"), atol=1e-6
    )


def test_a_sound_that_unpacks_to_much_is_there_once_and_at_the_wanted_rate(tmp_path):
    silence = np.zeros(30 * 96_000, np.int16)
    film = write_heard(tmp_path / "a.mkv", silence, 96_000)
    soundfile.write(tmp_path / "a.flac", silence, 96_000)
    kept = 30 * RATE * 4
    assert memory_of(lambda: read_sound(film)) < 2 * kept
    assert memory_of(lambda: read_sound_file(tmp_path / "a.flac")) < 2 * kept


def test_a_film_without_pictures_is_heard_from_its_start(tmp_path):
    sound = read_sound(write_heard(tmp_path / "a.mkv", noise(16_000), 16_000, pictures=False))
    assert len(sound.samples) == 16_000


def test_a_synthetic_recording_is_judged_too(tmp_path):
    capture = SyntheticCapture.__new__(SyntheticCapture)
    capture.path = tmp_path
    with wave.open(str(tmp_path / "audio.wav"), "wb") as file:
        file.setparams((1, 2, 1, 0, "NONE", ""))
        file.writeframes(bytes(2000))
    refused(lambda: capture.audio(), "claims 1 samples per second")


def test_what_is_taken_ends_where_it_is_said_to():
    assert not fault(Claim(48_000, 2, int(RECORDING * 48_000 / 2)))
    assert fault(Claim(48_000, 1, int(RECORDING * 48_000) + 1)) == "is longer than 7200 s"
    assert "GiB" in fault(Claim(384_000, 64, 600 * 384_000))
