"""Readers of single files: Gaussians, bundles, settings, personas, sounds."""

import warnings
from pathlib import Path

import numpy as np

from fuzz.reader import Reader
from fuzz.readers import samples
from ico3d.bundle.format import Bundle, give_voice
from ico3d.bundle.people.provenance import OPENVOICE, ClonedVoice
from ico3d.bundle.people.voice import SIZE
from ico3d.bundle.persona import read_persona
from ico3d.bundle.skinned.gestures import gesture_files
from ico3d.capture.sound import read_sound_file
from ico3d.chat.remote.recognition import read_wav
from ico3d.chat.services import choose
from ico3d.chat.settings.conversation import read_settings
from ico3d.speech.runtime import open_speech
from ico3d.splat.files.formats import read_gaussians, write_gaussians
from support.bundles import random_body, random_bundle, random_skinned, random_whole, skinned_person
from support.recordings import films
from support.splats.gaussian_files import as_gsply, gsply, ply_bytes, random_gaussians, splat_bytes


def _only(folder: Path) -> Path:
    """The one file of a folder."""
    return next(path for path in folder.rglob("*") if path.is_file())


def _gaussians(folder: Path) -> None:
    read_gaussians(_only(folder)).checked()


def _gaussian_files() -> dict:
    """A writer for each format."""
    many, few = random_gaussians(40, 3), random_gaussians(60, 0)

    def plain(folder: Path) -> bytes:
        data = ply_bytes(few, folder)
        (folder / "standard.ply").unlink()
        return data

    def by_gsply(folder: Path) -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            gsply.plywrite(str(folder / "c.compressed.ply"), as_gsply(many), compressed=True)

    return {
        "ply": lambda folder: ply_bytes(many, folder),
        "ascii": lambda f: (f / "a.ply").write_bytes(samples.ascii_ply(plain(f))),
        "big-endian": lambda f: (f / "b.ply").write_bytes(samples.ascii_ply(plain(f), ">")),
        "compressed": by_gsply,
        "spz 3": lambda folder: write_gaussians(folder / "3.spz", many),
        "spz 4": lambda f: gsply.write_spz(f / "4.spz", as_gsply(many), version=4),
        "splat": lambda folder: (folder / "a.splat").write_bytes(splat_bytes(few)),
    }


def _bundle(folder: Path) -> None:
    bundle = Bundle.open(_only(folder))
    speech = bundle.manifest.speech
    if speech is not None and speech.input == "mel":
        open_speech(bundle.read("speech.onnx"), speech.encoder, speech.sha256, speech.input)


def _person_on_bones(folder: Path) -> None:
    """A body on a skeleton with gestures."""
    path = folder / "avatar.ico3d"
    skinned_person.write_capsule_person(path, 60, 6)
    bundle = Bundle.open(path)
    assert bundle.skinned is not None
    files = {name: bundle.read(name) for name in bundle.manifest.files}
    files |= gesture_files(bundle.skinned, ())
    path.unlink()
    random_bundle.write_bundle(path, bundle.manifest, files)


def _voiced(folder: Path) -> None:
    """A head with a cloned voice."""
    path = folder / "a.ico3d"
    random_bundle.write_random_bundle(path, 20)
    give_voice(path, ClonedVoice(OPENVOICE, "me.mp4", "agreed"), np.ones(SIZE, np.float32), path)


SETTINGS = """
recognition = "browser"
allow = ["localhost"]
[language]
use = "openai"
url = "http://127.0.0.1:11434/v1"
model = "small"
[voice]
use = "espeak-ng"
[turns]
pause = 0.3
end_silence = 0.7
[[tools]]
name = "weather"
description = "Tells the weather."
url = "https://localhost/weather"
parameters = { place = "Name of the place." }
"""
PERSONA = """
name = "Ada"
greeting = "Hello."
manner = "You are kind."
languages = ["en", "pt-BR"]
notes = ["who are you | name => I am Ada.", "Ada lives in London."]
forbidden = ["politics | elections"]
voice = { espeak-ng = "en+f2" }
"""


def _settings(folder: Path) -> None:
    choose(read_settings(_only(folder)), {})


def _wav(folder: Path) -> None:
    """A sound as a recording has it, and as another machine sends it."""
    file = _only(folder)
    read_sound_file(file)
    with file.open("rb") as sound:
        read_wav(sound)


FILES = (
    Reader("Gaussians", _gaussian_files(), lambda: _gaussians),
    Reader(
        "bundle",
        {
            "head": lambda f: random_bundle.write_random_bundle(f / "a.ico3d", 20),
            "windows": lambda f: random_body.write_random_body(f / "a.ico3d"),
            "skinned": lambda f: random_skinned.write_random_skinned(f / "a.ico3d"),
            "whole": lambda f: random_whole.write_random_whole(f / "a.ico3d"),
            "gestures": _person_on_bones,
            "voice": _voiced,
        },
        lambda: _bundle,
    ),
    Reader(
        "settings",
        {"toml": lambda folder: (folder / "talk.toml").write_text(SETTINGS)},
        lambda: _settings,
    ),
    Reader(
        "persona",
        {"toml": lambda folder: (folder / "ada.toml").write_text(PERSONA)},
        lambda: lambda folder: read_persona(_only(folder)),
    ),
    Reader(
        "WAV",
        {
            "16 bits": lambda folder: films.write_wav(folder / "a.wav"),
            "stereo": lambda folder: films.write_wav(folder / "a.wav", 48_000, 2),
            "8 bits": lambda folder: films.write_wav(folder / "a.wav", 8000, 1, 1),
            "32 bits": lambda folder: films.write_wav(folder / "a.wav", 22_050, 2, 4),
        },
        lambda: _wav,
    ),
)
