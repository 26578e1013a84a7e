"""OpenVoice V2: MeloTTS speaks, and a tone-colour converter changes the voice to a person's.

Neither is in the package index; `docs/conversation/voices.md` says how to install them. Both belong
to MyShell and are MIT-licensed, as are their weights.
"""

import contextlib
import functools
import importlib.util
import tempfile
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ico3d.chat.services.provider import Context, lacks_weights
from ico3d.chat.services.voice.base import LOADING, PieceVoice, Spoken, at_speech_rate
from ico3d.chat.services.voice.cloning import Recording, permitted_recording
from ico3d.common.unpacking.weights import check_unpacked, load_weights
from ico3d.common.weights import model_of
from ico3d.errors import MissingModelError, SettingsError

LANGUAGES = {
    "EN": ("melotts-english", "Hello."),
    "ES": ("melotts-spanish", "Hola."),
    "FR": ("melotts-french", "Bonjour."),
    "ZH": ("melotts-chinese", "你好。"),
    "JP": ("melotts-japanese", "こんにちは。"),
    "KR": ("melotts-korean", "안녕하세요."),
}
"""For each language: the weights, and a first word, which makes MeloTTS load all of its models."""

INSTALL = "the commands are in docs/conversation/voices.md."


@dataclass(frozen=True)
class Settings:
    """Options of the voice `openvoice`.

    Attributes:
        voice: MeloTTS's speaker, which determines the language: EN-US, EN-BR, EN_INDIA, EN-AU,
            EN-Default, ES, FR, ZH, JP or KR.
        speed: Speed as a factor of the speaker's own, 0.25 to 4.
        reference: WAV file of the voice to imitate; empty for the speaker's own voice.
        consent: What the owner of that voice has agreed to, in one sentence; stored on this
            machine.
        consent_by: Name of the voice's owner.
        watermark: Whether converted speech carries OpenVoice's inaudible watermark, which takes
            time.
        device: `auto`, `cpu`, `cuda` or `mps`.
    """

    voice: str = "EN-US"
    speed: float = 1.0
    reference: str = ""
    consent: str = ""
    consent_by: str = ""
    watermark: bool = True
    device: str = "auto"

    def __post_init__(self):
        """Checks language and speed.

        Raises:
            SettingsError: If OpenVoice has no such language, or cannot speak so.
        """
        if self.language not in LANGUAGES:
            raise SettingsError(
                "chat settings: voice 'openvoice': voice must begin with "
                f"{' or '.join(LANGUAGES)}, not be '{self.voice}'."
            )
        if not 0.25 <= self.speed <= 4:
            raise SettingsError("chat settings: voice 'openvoice': speed must be 0.25 to 4.")

    @property
    def language(self) -> str:
        """MeloTTS's code of the language."""
        return self.voice[:2]

    @property
    def weights(self) -> str:
        """Name of the language's part of MeloTTS in `ico3d weights`."""
        return LANGUAGES[self.language][0]


@dataclass(frozen=True)
class OwnVoice(Settings):
    """Options of an avatar that has a voice of its own.

    Attributes:
        tone: Tone colour of that voice: 256 float32 values.
    """

    tone: bytes = b""


class Engine:
    """The models for some settings, shared by all sessions; speaks one text at a time."""

    def __init__(self, settings: Settings):
        """Loads the models, which takes a while.

        Raises:
            MissingModelError: If files are not installed.
            SettingsError: If packages, speaker, recording or consent are missing.
        """
        self._settings = settings
        self._lock = threading.Lock()
        self._converter: Any = None
        recording = permitted(settings)
        with loading():
            self._base = self._load_base()
            self._speaker_id = self._find_speaker()
            if recording or isinstance(settings, OwnVoice):
                self._converter = self._load_converter(recording)
            self.speak(LANGUAGES[settings.language][1])

    def speak(self, text: str) -> Spoken:
        """Speaks a text."""
        with self._lock:
            samples = self._base.tts_to_file(
                text, self._speaker_id, None, speed=self._settings.speed, quiet=True
            )
            rate = self._base.hps.data.sampling_rate
            if self._converter is not None:
                samples, rate = self._converted(samples, rate)
        return Spoken(at_speech_rate(samples, rate))

    def _load_base(self) -> Any:
        folder = model_of(self._settings.weights)
        from melo.api import TTS

        return TTS(
            self._settings.language,
            self._settings.device,
            config_path=str(folder / "config.json"),
            ckpt_path=str(folder / "checkpoint.pth"),
        )

    def _find_speaker(self) -> int:
        speakers = dict(self._base.hps.data.spk2id.items())
        if self._settings.voice not in speakers:
            known = " or ".join(speakers)
            raise SettingsError(f"chat settings: voice 'openvoice': voice must be {known}.")
        return speakers[self._settings.voice]

    def _load_converter(self, recording: Recording | None) -> Any:
        """The converter to the voice of a recording; without one to the avatar's own."""
        import torch

        device = str(self._base.device)
        converter = load_converter(device)
        if not self._settings.watermark:
            converter.watermark_model = None  # its constructor does not take this wish
        if isinstance(self._settings, OwnVoice):
            target = np.frombuffer(self._settings.tone, np.float32).reshape(1, -1, 1).copy()
        else:
            assert recording is not None
            target = recording.embedding(lambda path: extract(converter, path))
        self._target = torch.from_numpy(target).to(device)
        name = self._settings.voice.lower().replace("_", "-")
        source = model_of("openvoice") / "base_speakers" / "ses" / f"{name}.pth"
        self._source = load_weights(source, device)
        return converter

    def _converted(self, samples: np.ndarray, rate: int) -> tuple[np.ndarray, int]:
        """The same words in the voice of the reference, and their rate."""
        import soundfile

        with tempfile.TemporaryDirectory(prefix="ico3d-") as folder:
            path = Path(folder) / "base.wav"
            soundfile.write(path, samples, rate)
            converted = self._converter.convert(str(path), self._source, self._target)
        return converted, self._converter.hps.data.sampling_rate


def load_converter(device: str) -> Any:
    """OpenVoice's converter of tone colours.

    Raises:
        MissingModelError: If its weights are not installed.
    """
    folder = model_of("openvoice") / "converter"
    from openvoice.api import ToneColorConverter

    converter = ToneColorConverter(str(folder / "config.json"), device=device)
    check_unpacked(folder / "checkpoint.pth")
    converter.load_ckpt(str(folder / "checkpoint.pth"))
    return converter


def extract(converter: Any, path: str) -> np.ndarray:
    """(1, 256, 1) the tone colour of a recording."""
    return converter.extract_se([path]).cpu().numpy()


def tone_colour(path: Path) -> np.ndarray:
    """(256,) float32 tone colour of a recording; its owner's consent is the caller's to ask for.

    Raises:
        MissingModelError: If files are not installed.
        SettingsError: If packages are not installed.
    """
    with loading():
        tone = extract(load_converter("cpu"), str(path))
    return np.ascontiguousarray(tone.reshape(-1), np.float32)


def permitted(settings: Settings) -> Recording | None:
    """The recording of the voice to imitate; None for the speaker's own voice.

    Raises:
        SettingsError: If the recording cannot be read, or its owner has not consented.
    """
    if not settings.reference:
        return None
    path = Path(settings.reference).expanduser()
    return permitted_recording(path, settings.consent, settings.consent_by)


@contextlib.contextmanager
def loading() -> Iterator[None]:
    """Turns errors in the `with` block into one sentence on what is missing; prevents downloads.

    Raises:
        SettingsError: If a package is not installed or an option is refused.
        MissingModelError: If files of a model are not installed.
    """
    try:
        with offline():
            yield
    except ModuleNotFoundError as error:
        raise SettingsError(
            f"OpenVoice needs the package '{error.name}', which is not installed: {INSTALL}"
        ) from error
    except OSError as error:
        raise MissingModelError(
            f"OpenVoice lacks a part that would have to be downloaded ({error}): {INSTALL}"
        ) from error


@contextlib.contextmanager
def offline() -> Iterator[None]:
    """Keeps Hugging Face's libraries from downloading; they still use their cache."""
    try:
        from huggingface_hub import constants
    except ImportError:
        yield
        return
    before, constants.HF_HUB_OFFLINE = constants.HF_HUB_OFFLINE, True
    try:
        yield
    finally:
        constants.HF_HUB_OFFLINE = before


engine = functools.cache(Engine)
"""The engine for some settings, loaded once per process."""


def hindrance(settings: Settings) -> str:
    """A sentence on missing packages or weights; empty if OpenVoice works."""
    converts = settings.reference or isinstance(settings, OwnVoice)
    return _lack(("melo", "openvoice"), (settings.weights, *(["openvoice"] if converts else [])))


def cloning_hindrance() -> str:
    """A sentence on what is missing to take a tone colour from a recording; empty if nothing is."""
    return _lack(("openvoice",), ("openvoice",))


def _lack(packages: tuple[str, ...], weights: tuple[str, ...]) -> str:
    """A sentence on the first that is not installed, else empty."""
    for package in packages:
        if importlib.util.find_spec(package) is None:
            return f"{package} is not installed: {INSTALL}"
    return next((lack for name in weights if (lack := lacks_weights(name))), "")


def detail(settings: Settings) -> str:
    """Says of an avatar's own voice that it is one."""
    return "own voice" if isinstance(settings, OwnVoice) else ""


def make(settings: Settings, context: Context) -> PieceVoice:
    """Creates the voice of one session.

    Raises:
        MissingModelError: If files are not installed.
        SettingsError: If packages, speaker, recording or consent are missing.
    """
    with LOADING:
        return PieceVoice(settings.voice, engine(settings).speak)
