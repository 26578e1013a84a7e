"""Films of people who talk: what they do, the file, and the packaged avatar's lips."""

import os
import shutil
from pathlib import Path

import av
import numpy as np
import pytest
import soundfile
import torch

from ico3d.avatar.baking.person_bundle import animation_of
from ico3d.avatar.film.actor import avatar_actor, bundle_actor
from ico3d.avatar.film.command import Render
from ico3d.avatar.film.film import pictures
from ico3d.avatar.film.performance import motion, speech
from ico3d.avatar.render_bundle import visitor_camera
from ico3d.bundle import packaged
from ico3d.bundle.format import Bundle, add_files, read_background
from ico3d.capture.capture import Sound
from ico3d.errors import BundleError, ModelError, SettingsError
from ico3d.speech.runtime import SpeechModel
from ico3d.splat.files.formats import write_gaussians
from ico3d.splat.files.raw import RawGaussians
from ico3d.splat.gaussians import Gaussians
from support.avatars.whole_person import write_whole_person
from support.bundles.random_body import write_random_body
from support.bundles.random_bundle import write_random_bundle
from support.bundles.random_whole import FRAMES, write_random_whole
from support.shared import SPEECH

pytestmark = pytest.mark.slow

FPS, RATE = 15.0, 16_000


def hum(seconds: float) -> Sound:
    times = np.arange(round(seconds * RATE)) / RATE
    wave = 0.3 * np.sin(2 * np.pi * 220 * times) * np.sin(3 * times) ** 2
    return Sound(wave.astype(np.float32), RATE)


@pytest.fixture(scope="module")
def bundles(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("bundles")
    write_random_whole(folder / "whole.ico3d")
    write_random_bundle(folder / "head.ico3d", 60)
    write_random_body(folder / "body.ico3d")
    return folder


def test_lips_follow_the_sound_and_the_body_returns_to_rest(bundles):
    bundle = Bundle.open(bundles / "whole.ico3d")
    actor, sound = bundle_actor(bundle), hum(2.0)
    talk = speech(actor, sound, 3)
    lips = SpeechModel(bundle.read("speech.onnx")).expressions(sound.samples, RATE)
    np.testing.assert_allclose(talk.face.rows[:, :32], lips, atol=1e-6)
    assert talk.seconds == 2.0
    assert talk.times[0] == 0 and talk.times[-1] == pytest.approx(2.0, abs=1 / FPS)
    assert talk.body_times[-1] == pytest.approx(bundle.animation.rest.end / FPS)
    assert np.ptp(talk.body_times) > 0.1 and talk.body_times.max() <= (FRAMES - 1) / FPS
    at = 20 / 25  # a row of the expressions
    expected = actor.draw(np.interp(at, talk.times, talk.body_times), talk.face.rows[20])
    drawn = talk.gaussians(at)
    torch.testing.assert_close(drawn.means, expected.means)
    torch.testing.assert_close(drawn.colors, expected.colors)


def test_the_seed_decides_blinks_and_gestures(bundles):
    actor = bundle_actor(Bundle.open(bundles / "whole.ico3d"))
    one, same, other = (speech(actor, hum(8.0), seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one.body_times, same.body_times)
    np.testing.assert_array_equal(one.face.rows, same.face.rows)
    assert one.body_times.tolist() != other.body_times.tolist()
    lids = [talk.face.rows[:, 37] for talk in (one, other)]
    assert max(lids[0]) > 0.9 and np.abs(lids[0] - lids[1]).max() > 0.5
    np.testing.assert_array_equal(one.face.rows[:, :32], other.face.rows[:, :32])


def test_a_head_alone_sways_back_and_forth(bundles):
    bundle = Bundle.open(bundles / "head.ico3d")
    actor = bundle_actor(bundle)
    talk = speech(actor, hum(5.0), 0)
    assert actor.portrait == actor.view == bundle.manifest.camera
    assert actor.seconds == pytest.approx(49 / 25) and talk.body_times[-1] == 5.0
    face = talk.face.rows[50]
    there, back = actor.draw(49 / 25 - 0.4, face), actor.draw(49 / 25 + 0.4, face)
    torch.testing.assert_close(there.means, back.means)
    assert (there.means - actor.draw(0.2, face).means).abs().max() > 1e-3


def test_without_sound_the_recorded_motion_plays_back_and_forth(bundles):
    for name in ("whole", "body", "head"):
        actor = bundle_actor(Bundle.open(bundles / f"{name}.ico3d"))
        shown = motion(actor, 2.5 * actor.seconds, 0)
        places = [np.interp(t, shown.times, shown.body_times) for t in actor.seconds * np.arange(3)]
        np.testing.assert_allclose(places, [0, actor.seconds, 0], atol=1e-6)
        a, b = (shown.gaussians(actor.seconds * t).means for t in (0.5, 1.5))
        torch.testing.assert_close(a, b, atol=1e-4, rtol=1e-4)


def streams(path: Path) -> tuple[float, float, int, np.ndarray]:
    """Seconds of video and sound, pictures, and the sound's samples."""
    with av.open(str(path)) as file:
        lengths = [float(s.duration * s.time_base) for s in (file.streams[0], file.streams[1])]
        pictures = sum(1 for _ in file.decode(video=0))
    with av.open(str(path)) as file:
        heard = np.concatenate([frame.to_ndarray()[0] for frame in file.decode(audio=0)])
    return *lengths, pictures, heard


def check_streams(path: Path, seconds: float, fps: float, sound: np.ndarray) -> None:
    """Both are as long as the speech, within a picture, and begin together."""
    video, audio, pictures, heard = streams(path)
    assert abs(video - seconds) <= 1 / fps and abs(audio - seconds) <= 1 / fps
    assert pictures == round(seconds * fps)
    length = 1 << 20
    spectrum = np.fft.rfft(heard, length) * np.fft.rfft(sound, length).conj()
    shift = int(np.fft.irfft(spectrum).argmax())
    assert min(shift, length - shift) < 0.005 * 48_000


def said(tmp_path, seconds: float = 1.21) -> tuple[Path, np.ndarray]:
    """A sound file, and what it holds at 48 kHz."""
    noise = np.random.default_rng(0).normal(0, 0.1, round(seconds * 48_000))
    smooth = np.convolve(noise, np.hanning(40) / 20, "same").astype(np.float32)
    soundfile.write(tmp_path / "said.wav", smooth, 48_000)
    return tmp_path / "said.wav", smooth


@pytest.mark.parametrize("name", ["whole", "head"])
def test_a_film_of_a_bundle_is_as_long_as_its_sound(bundles, tmp_path, name):
    file, sound = said(tmp_path)
    Render(bundles / f"{name}.ico3d", tmp_path / "a.mp4", audio=file, size=(48,)).run()
    check_streams(tmp_path / "a.mp4", 1.21, 30, sound)


def test_a_film_of_the_exact_person(tmp_path):
    avatar = write_whole_person(tmp_path / "avatar")
    actor = avatar_actor(avatar, animation_of(tmp_path / "avatar", avatar), None)
    assert actor.seconds == avatar.seconds and len(actor.idle) == 39
    low = avatar.gaussians(0.0).means.min(0).values.numpy()
    assert actor.view.eye[2] > 1 and low[1] < actor.view.target[1] < 1.7
    camera = visitor_camera(actor.portrait, 256, 256)
    head = avatar.head_gaussians(0.3).means.numpy().astype(float)
    pixels, depths = camera.project(head)
    assert (depths > 0).all() and 60 < np.ptp(pixels[:, 1]) < 128  # a face that can be found
    assert pixels.min() > 0 and pixels.mean(0)[1] < 110
    file, sound = said(tmp_path, 0.6)
    Render(tmp_path / "avatar", tmp_path / "a.mp4", audio=file, size=(48, 64), fps=25).run()
    check_streams(tmp_path / "a.mp4", 0.6, 25, sound)


def test_a_silent_film_goes_around_a_bundle(bundles, tmp_path):
    Render(bundles / "whole.ico3d", tmp_path / "a.mp4", size=(48,), seconds=0.3).run()
    with av.open(str(tmp_path / "a.mp4")) as file:
        assert len(file.streams) == 1 and sum(1 for _ in file.decode(video=0)) == 9


def test_what_stands_behind_is_in_the_film(bundles, tmp_path):
    ground = Gaussians(
        means=torch.tensor([[0.0, 0.0, -3.0]]),
        quats=torch.tensor([[1.0, 0, 0, 0]]),
        scales=torch.full((1, 3), 1.0),
        opacities=torch.tensor([0.99]),
        colors=torch.tensor([[0.1, 0.7, 0.2]]),
    )
    path = tmp_path / "a.ico3d"
    shutil.copy(bundles / "whole.ico3d", path)
    write_gaussians(tmp_path / "ground.ply", RawGaussians.from_gaussians(ground))
    add_files(path, read_background(tmp_path / "ground.ply"))
    actor = bundle_actor(Bundle.open(path))
    torch.testing.assert_close(actor.backdrop.colors, ground.colors, atol=1e-5, rtol=0)
    torch.testing.assert_close(actor.backdrop.means, ground.means)
    shown, camera = motion(actor, 1.0, 0), visitor_camera(actor.view, 32, 32)
    with_it, without = (
        next(pictures(shown, [camera], 30, actor.background, behind))
        for behind in (actor.backdrop, None)
    )
    assert np.abs(with_it[16, 28].astype(int) - without[16, 28]).max() > 15
    with pytest.raises(BundleError, match=r"named \.spz or \.ply"):
        read_background(tmp_path / "ground.obj")


def test_who_cannot_talk_is_told(bundles, tmp_path):
    file, _ = said(tmp_path, 0.2)
    out = tmp_path / "a.mp4"
    with pytest.raises(SettingsError, match="no face here that sound moves"):
        Render(bundles / "body.ico3d", out, audio=file).run()
    with pytest.raises(SettingsError, match="there is no sound in"):
        Render(bundles / "head.ico3d", out, audio=tmp_path / "nothing.wav").run()
    shutil.copytree(write_body(tmp_path), tmp_path / "alone")
    with pytest.raises(SettingsError, match="body alone, which does not talk"):
        Render(tmp_path / "alone", out, audio=file).run()
    with pytest.raises(SettingsError, match="--path start"):
        Render(tmp_path / "alone", out, path="start").run()
    with pytest.raises(ModelError):
        Render(tmp_path, out).run()
    assert not out.exists()


def write_body(tmp_path) -> Path:
    write_whole_person(tmp_path / "avatar")
    return tmp_path / "avatar" / "body"


needs_face = pytest.mark.skipif(
    not Path(os.environ.get("ICO3D_MODELS", ""), "face_landmarker.task").is_file(),
    reason="no face_landmarker.task in $ICO3D_MODELS",
)
needs_demo = pytest.mark.skipif(not packaged.FILE.is_file(), reason="no packaged avatar")


def lips_in_film(file: Path, tmp_path: Path, fps: float) -> tuple[np.ndarray, np.ndarray]:
    """Lip gaps (T,) in a film of the packaged avatar, NaN without a face, and the loudness (T,)."""
    from ico3d.measure.lips import LandmarkReader, lip_gap

    pytest.importorskip("mediapipe")
    Render(Path("demo"), tmp_path / "a.mp4", audio=file, size=(192,), fps=fps).run()
    sound, rate = soundfile.read(file)
    check_streams(tmp_path / "a.mp4", len(sound) / rate, fps, resampled(sound, rate))
    gaps = []
    with LandmarkReader() as reader, av.open(str(tmp_path / "a.mp4")) as film:
        for frame in film.decode(video=0):
            seen = reader.read(frame.to_ndarray(format="rgb24") / 255)
            gaps.append(np.nan if seen is None else lip_gap(seen))
    times, reach = np.arange(len(gaps)) / fps, round(0.04 * rate)
    around = [sound[max(0, round(t * rate) - reach) :][: 2 * reach] for t in times]
    return np.array(gaps), np.array([np.sqrt(np.square(part).mean()) for part in around])


def resampled(sound: np.ndarray, rate: int) -> np.ndarray:
    import soxr

    return soxr.resample(sound, rate, 48_000)


@needs_face
@needs_demo
def test_the_demos_lips_open_when_the_sounds_do(tmp_path):
    from ico3d.common.espeak.speech import synthesize
    from ico3d.measure.lips import lip_lag_ms
    from ico3d.speech.articulation import articulation_track

    text = "My father packed papa's map. A bobcat may pop out."
    voice = synthesize(text, "en-us", rate=150)
    soundfile.write(tmp_path / "voice.wav", voice.samples, voice.rate)
    gaps, _ = lips_in_film(tmp_path / "voice.wav", tmp_path, 20)
    seconds = len(voice.samples) / voice.rate
    opened = articulation_track(voice.events, seconds, np.arange(len(gaps)) / 20)[:, 0]
    assert np.isfinite(gaps).mean() >= 0.95
    lag = lip_lag_ms(gaps, opened, 20)
    assert lag is not None and abs(lag) <= 40


@needs_face
@needs_demo
@pytest.mark.skipif(not SPEECH.is_dir(), reason="no recordings of human speech (../shared/speech)")
def test_the_demos_lips_follow_a_human_voice(tmp_path):
    from ico3d.measure.lips import lip_lag_ms

    sound, rate = soundfile.read(SPEECH / "jfk_16k.wav")
    soundfile.write(tmp_path / "voice.wav", sound[: 4 * rate], rate)
    gaps, loudness = lips_in_film(tmp_path / "voice.wav", tmp_path, 20)
    assert np.isfinite(gaps).mean() >= 0.95
    lag = lip_lag_ms(gaps, loudness, 20)
    assert lag is not None and abs(lag) <= 40
