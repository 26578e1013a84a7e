"""Speech recognition with Whisper on this machine, through faster-whisper."""

import functools
import os
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipecat.processors.frame_processor import FrameProcessor

from ico3d.chat.services.provider import Context, lacks_package
from ico3d.chat.services.recognition.segments import LONGEST_SPEECH, check_longest_speech
from ico3d.chat.services.recognition.whisper_files import check_whisper
from ico3d.common.catalogue.table import TABLE
from ico3d.common.weights import cached
from ico3d.errors import MissingExtraError, MissingModelError, SettingsError

AUTO = "auto"
ON_CUDA = ("large-v3", "large-v3-turbo", "small", "base", "tiny")
ON_CPU = ("base", "tiny")  # what is larger takes seconds longer than a visitor waits
DISTILLED, SMALL_ENGLISH = "distil-large-v3", "tiny.en"
ENGLISH = (DISTILLED, SMALL_ENGLISH)  # know no other language
NAMES = (AUTO, *ON_CUDA, *ENGLISH)
"""What names of models stand for; a folder of such a name is none, wherever a server is started."""
MOST_THREADS = 4  # of a CPU; more gain nothing for a few seconds of sound
NEEDED = ("model.bin", "tokenizer.json")  # what is missing would be downloaded in mid-talk
_loading = threading.Lock()


@dataclass(frozen=True)
class Settings:
    """Options of the recogniser `whisper`.

    Attributes:
        model: Name of a model whose weights are installed, such as `large-v3` or `distil-large-v3`;
            a folder with a model that was converted for CTranslate2; or `auto`: the best installed
            model that is fast enough on this machine.
        language: Code of the spoken language, such as `de`; empty to detect the language of each
            stretch of speech.
        device: `cuda`, `cpu`, or `auto`: CUDA if there is a device.
        precision: CTranslate2's type of computation, such as `int8`; `auto` takes `float16` on
            CUDA and `int8` on a CPU.
        longest_speech: Seconds of unbroken speech that are recognised at once, 5 to 300; longer
            speech is cut at a quiet place, and the pieces form one turn.
    """

    model: str = AUTO
    language: str = ""
    device: str = AUTO
    precision: str = AUTO
    longest_speech: float = LONGEST_SPEECH

    def __post_init__(self):
        """Checks ranges.

        Raises:
            SettingsError: If speech is cut too soon or too late.
        """
        check_longest_speech(self.longest_speech, "chat settings: recognition 'whisper'")


def hindrance(settings: Settings) -> str:
    """A sentence on a missing package or missing weights, else empty."""
    missing = lacks_package("faster_whisper", "whisper")
    if missing:
        return missing
    try:
        find(settings)
    except (MissingModelError, SettingsError) as error:
        return str(error)
    return ""


def make(settings: Settings, context: Context) -> FrameProcessor:
    """Creates the recogniser of one session; all sessions share the model.

    Raises:
        MissingExtraError: If faster-whisper is not installed.
        MissingModelError: If the weights are not installed.
        ModelError: If the model's files do not agree with each other.
        SettingsError: If the model cannot be loaded with these options, or does not know the
            language.
    """
    if lacks_package("faster_whisper", "whisper"):
        raise MissingExtraError("faster-whisper", "whisper", "Whisper")
    from ico3d.chat.services.recognition.whisper_service import WhisperRecognition

    folder = find(settings)
    device = computes_on(settings)
    precision = settings.precision
    if precision == AUTO:
        precision = "float16" if device == "cuda" else "int8"
    with _loading:
        model = load(folder, device, precision)
    language = settings.language or ("en" if settings.model in ENGLISH else None)
    if language is not None and language not in model.supported_languages:
        raise SettingsError(f"Whisper '{folder.name}' does not know the language '{language}'.")
    return WhisperRecognition(model, language, settings.longest_speech)


def find(settings: Settings) -> Path:
    """Folder of the model that the settings choose.

    Raises:
        MissingModelError: If no such model is installed; the sentence says how to get one.
        SettingsError: If the name is unknown.
    """
    if settings.model not in NAMES and os.path.isdir(settings.model):
        return complete(Path(settings.model))
    names = candidates(settings)
    for name in names:
        folder = cached(weights_name(name))
        if folder is not None:
            return complete(folder)
    wanted = TABLE[weights_name(names[0])]
    raise MissingModelError(
        f"the weights of Whisper {names[0]} are not here: ico3d weights fetch {wanted.name} "
        f"({wanted.size / 1e6:.0f} MB, {wanted.licence})."
    )


def candidates(settings: Settings) -> tuple[str, ...]:
    """Names of the models that the settings allow, the preferred one first.

    Raises:
        SettingsError: If the settings name an unknown model.
    """
    if settings.model != AUTO:
        if settings.model not in NAMES:
            names = " or ".join(NAMES)
            raise SettingsError(
                f"Whisper '{settings.model}' is unknown, use {names}, or the folder of a model."
            )
        return (settings.model,)
    english = settings.language == "en"
    if computes_on(settings) != "cuda":
        return (*ON_CPU[:-1], SMALL_ENGLISH, *ON_CPU[-1:]) if english else ON_CPU
    return (DISTILLED, *ON_CUDA) if english else ON_CUDA


def weights_name(model: str) -> str:
    """Name of a model in `ico3d weights`."""
    return model if model == DISTILLED else f"whisper-{model}"


def complete(folder: Path) -> Path:
    """The folder itself, if it holds all files of a model.

    Raises:
        MissingModelError: If a file is missing.
    """
    for name in NEEDED:
        if not os.path.isfile(folder / name):
            raise MissingModelError(f"the Whisper model in {folder} has no {name}: fetch it again.")
    return folder


def computes_on(settings: Settings) -> str:
    """The device to compute on: `cuda` or `cpu`."""
    if settings.device == AUTO:
        return "cuda" if cuda_devices() else "cpu"
    return settings.device


@functools.cache
def cuda_devices() -> int:
    """Number of CUDA devices that CTranslate2 can use."""
    from ctranslate2 import get_cuda_device_count

    return get_cuda_device_count()


@functools.cache
def load(folder: Path, device: str, precision: str) -> Any:
    """Loads a `faster_whisper.WhisperModel`, once per process.

    Raises:
        ModelError: If the folder's files do not agree with each other.
        SettingsError: If the model cannot be loaded with these options.
    """
    from faster_whisper import WhisperModel

    from ico3d.chat.services.recognition.short_whisper import ShortWhisper

    check_whisper(folder)
    kind = ShortWhisper if device == "cpu" else WhisperModel  # GPUs do not notice the difference
    # A core is left to voice and turns: threads that wait for each other take longer than fewer.
    threads = max(1, min(MOST_THREADS, (os.cpu_count() or 1) - 1))
    options = {"compute_type": precision, "cpu_threads": threads, "local_files_only": True}
    try:
        return kind(str(folder), device, **options)
    except (RuntimeError, ValueError) as error:
        raise SettingsError(
            f"Whisper in {folder} cannot be used on {device} with {precision}: {error}."
        ) from error
