"""OpenVoice V2: MeloTTS speaks, and a tone-colour converter gives it a person's voice.

Neither is on the package index; `docs/conversation/voices.md` says how to install them. Both
belong to MyShell and are MIT-licensed, as are their weights.
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
from ico3d.chat.services.voice.cloning import Recording, permitted_recording
from ico3d.chat.services.voice.pieces import LOADING, PieceVoice, at_speech_rate
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
"""What it speaks: weights, and a first word, which loads the rest of its models."""

INSTALL = "the commands are in docs/conversation/voices.md."


@dataclass(frozen=True)
class Settings:
    """Whose voice.

    Attributes:
        voice: MeloTTS's speaker, who decides on the language: EN-US, EN-BR, EN_INDIA, EN-AU,
            EN-Default, ES, FR, ZH, JP or KR.
        speed: 1 is its own pace; 0.25 to 4.
        reference: WAV file of the voice to speak with; empty for the speaker's own voice.
        consent: What the owner of that voice has agreed to, in one sentence; kept on this machine.
        consent_by: The owner's name.
        watermark: Whether converted speech carries OpenVoice's inaudible mark; it takes time.
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
        """MeloTTS's code."""
        return self.voice[:2]

    @property
    def weights(self) -> str:
        """What `ico3d weights` calls MeloTTS's part for the language."""
        return LANGUAGES[self.language][0]


class Engine:
    """The models of one choice of settings, shared by all sessions; one text at a time."""

    def __init__(self, settings: Settings):
        """Loads them, which takes a while.

        Raises:
            MissingModelError: If files are not there.
            SettingsError: If packages, speaker, recording or consent are missing.
        """
        self._settings = settings
        self._lock = threading.Lock()
        self._converter: Any = None
        recording = permitted(settings)
        with loading():
            self._base = self._load_base()
            self._speaker_id = self._find_speaker()
            if recording:
                self._converter = self._load_converter(recording)
            self.speak(LANGUAGES[settings.language][1])

    def speak(self, text: str) -> np.ndarray:
        """A text as (S,) int16 samples at 24 kHz."""
        with self._lock:
            samples = self._base.tts_to_file(
                text, self._speaker_id, None, speed=self._settings.speed, quiet=True
            )
            rate = self._base.hps.data.sampling_rate
            if self._converter is not None:
                samples, rate = self._converted(samples, rate)
        return at_speech_rate(samples, rate)

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

    def _load_converter(self, recording: Recording) -> Any:
        folder = model_of("openvoice")
        import torch
        from openvoice.api import ToneColorConverter

        device = str(self._base.device)
        converter = ToneColorConverter(str(folder / "converter" / "config.json"), device=device)
        checkpoint = folder / "converter" / "checkpoint.pth"
        converter.load_ckpt(str(checkpoint))
        if not self._settings.watermark:
            converter.watermark_model = None  # its constructor does not take this wish
        target = recording.embedding(lambda path: converter.extract_se([path]).cpu().numpy())
        self._target = torch.from_numpy(target).to(device)
        name = self._settings.voice.lower().replace("_", "-")
        source = folder / "base_speakers" / "ses" / f"{name}.pth"
        self._source = torch.load(source, map_location=device, weights_only=True)
        return converter

    def _converted(self, samples: np.ndarray, rate: int) -> tuple[np.ndarray, int]:
        """The same words in the voice of the reference, and their rate."""
        import soundfile

        with tempfile.TemporaryDirectory(prefix="ico3d-") as folder:
            path = Path(folder) / "base.wav"
            soundfile.write(path, samples, rate)
            converted = self._converter.convert(str(path), self._source, self._target)
        return converted, self._converter.hps.data.sampling_rate


def permitted(settings: Settings) -> Recording | None:
    """The recording to speak like; null for the speaker's own voice.

    Raises:
        SettingsError: If it cannot be read, or its owner has not consented.
    """
    if not settings.reference:
        return None
    path = Path(settings.reference).expanduser()
    return permitted_recording(path, settings.consent, settings.consent_by)


@contextlib.contextmanager
def loading() -> Iterator[None]:
    """Says in one sentence what is missing; nothing is downloaded meanwhile."""
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
    """Keeps Hugging Face's libraries from downloading; what is in their cache is found."""
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
"""The engine of some settings, loaded once."""


def hindrance(settings: Settings) -> str:
    """What OpenVoice lacks here, packages or weights; empty if it works."""
    for package in ("melo", "openvoice"):
        if importlib.util.find_spec(package) is None:
            return f"{package} is not installed: {INSTALL}"
    needed = (settings.weights, "openvoice") if settings.reference else (settings.weights,)
    return next((lack for name in needed if (lack := lacks_weights(name))), "")


def make(settings: Settings, context: Context) -> PieceVoice:
    """A voice for one session.

    Raises:
        MissingModelError: If files are not there.
        SettingsError: If packages, speaker, recording or consent are missing.
    """
    with LOADING:
        return PieceVoice(settings.voice, engine(settings).speak)
