"""OpenVoice V2: MeloTTS speaks, and a tone-colour converter gives it a person's voice.

Neither is on the package index; `docs/conversation.md` says how to install them. Both belong to
MyShell and are MIT-licensed, as are their weights.
"""

import contextlib
import importlib.util
import tempfile
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ico3d.chat.services.provider import Context
from ico3d.chat.services.voice.cloning import Recording, permitted_recording
from ico3d.chat.services.voice.pieces import PieceVoice, at_speech_rate
from ico3d.chat.services.voice.weights import require_files, weights_folder
from ico3d.errors import MissingModelError, SettingsError

LANGUAGES = {
    "EN": "Hello.",
    "ES": "Hola.",
    "FR": "Bonjour.",
    "ZH": "你好。",
    "JP": "こんにちは。",
    "KR": "안녕하세요.",
}
"""What it speaks, and a first word in each, which loads the rest of its models."""


@dataclass(frozen=True)
class Settings:
    """Whose voice.

    Attributes:
        language: EN, ES, FR, ZH, JP or KR.
        speaker: MeloTTS's speaker, such as `EN-US`; empty for the language's first.
        speed: 1 is its own pace.
        reference: WAV file of the voice to speak with; empty for the speaker's own voice.
        consent: What the owner of that voice has agreed to, in one sentence; kept on this machine.
        consent_by: The owner's name.
        watermark: Whether converted speech carries OpenVoice's inaudible mark; it takes time.
        device: `auto`, `cpu`, `cuda` or `mps`.
        folder: Where the checkpoints lie; empty for where `ico3d weights fetch openvoice` puts
            them.
    """

    language: str = "EN"
    speaker: str = ""
    speed: float = 1.0
    reference: str = ""
    consent: str = ""
    consent_by: str = ""
    watermark: bool = True
    device: str = "auto"
    folder: str = ""

    def __post_init__(self):
        """Checks language and speed.

        Raises:
            SettingsError: If OpenVoice has no such language, or cannot speak so.
        """
        if self.language not in LANGUAGES:
            raise SettingsError(
                f"chat settings: voice 'openvoice': language must be {' or '.join(LANGUAGES)}."
            )
        if not 0.25 <= self.speed <= 4:
            raise SettingsError("chat settings: voice 'openvoice': speed must be 0.25 to 4.")


@dataclass(frozen=True)
class Files:
    """Where the parts of OpenVoice V2 lie, as its own archive and MeloTTS name them."""

    folder: Path
    language: str

    @property
    def base(self) -> tuple[Path, Path]:
        """MeloTTS's description and weights of the language."""
        folder = self.folder / "melo" / self.language
        return folder / "config.json", folder / "checkpoint.pth"

    @property
    def converter(self) -> tuple[Path, Path]:
        """The tone-colour converter's description and weights."""
        folder = self.folder / "converter"
        return folder / "config.json", folder / "checkpoint.pth"

    def embedding(self, speaker: str) -> Path:
        """The embedding of one of MeloTTS's speakers."""
        name = speaker.lower().replace("_", "-")
        return self.folder / "base_speakers" / "ses" / f"{name}.pth"


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
        self._files = Files(weights_folder("openvoice", settings.folder), settings.language)
        self._converter: Any = None
        recording = permitted(settings)
        with loading():
            self._base = self._load_base()
            self._speaker, self._speaker_id = self._find_speaker()
            if recording:
                self._converter = self._load_converter(recording)
            self.speak(LANGUAGES[settings.language])

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
        config, checkpoint = self._files.base
        require_files("openvoice", config, checkpoint)
        from melo.api import TTS

        language, device = self._settings.language, self._settings.device
        return TTS(language, device, config_path=str(config), ckpt_path=str(checkpoint))

    def _find_speaker(self) -> tuple[str, int]:
        speakers = dict(self._base.hps.data.spk2id.items())
        name = self._settings.speaker or next(iter(speakers))
        if name not in speakers:
            known = " or ".join(speakers)
            raise SettingsError(f"chat settings: voice 'openvoice': speaker must be {known}.")
        return name, speakers[name]

    def _load_converter(self, recording: Recording) -> Any:
        config, checkpoint = self._files.converter
        source = self._files.embedding(self._speaker)
        require_files("openvoice", config, checkpoint, source)
        import torch
        from openvoice.api import ToneColorConverter

        device = str(self._base.device)
        converter = ToneColorConverter(str(config), device=device)
        converter.load_ckpt(str(checkpoint))
        if not self._settings.watermark:
            converter.watermark_model = None  # its constructor does not take this wish
        target = recording.embedding(lambda path: converter.extract_se([path]).cpu().numpy())
        self._target = torch.from_numpy(target).to(device)
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
            f"the OpenVoice voice needs the package '{error.name}', which is not installed: "
            "the command is in docs/conversation.md under 'Voice'."
        ) from error
    except OSError as error:
        raise MissingModelError(
            f"OpenVoice lacks a part that would have to be downloaded ({error}): "
            "fetch it with `ico3d weights fetch openvoice`."
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


_LOADING = threading.Lock()
_ENGINES: dict[Settings, Engine] = {}


def engine(settings: Settings) -> Engine:
    """The engine of these settings, loaded once."""
    with _LOADING:
        if settings not in _ENGINES:
            _ENGINES[settings] = Engine(settings)
        return _ENGINES[settings]


def works(settings: Settings) -> bool:
    """Whether packages and files are there."""
    files = Files(weights_folder("openvoice", settings.folder), settings.language)
    installed = all(importlib.util.find_spec(name) for name in ("melo", "openvoice"))
    return installed and all(path.is_file() for path in files.base)


def make(settings: Settings, context: Context) -> PieceVoice:
    """A voice for one session.

    Raises:
        MissingModelError: If files are not there.
        SettingsError: If packages, speaker, recording or consent are missing.
    """
    return PieceVoice(settings.speaker or settings.language, engine(settings).speak)
