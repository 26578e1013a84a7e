"""Qwen2-0.5B-Instruct in this process, through transformers."""

import os
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from pipecat.processors.frame_processor import FrameProcessor

from ico3d.chat.services.language.instruction import instruction
from ico3d.chat.services.language.sampling import check_sampling
from ico3d.chat.services.provider import Context, lacks_package
from ico3d.common.files import resolved
from ico3d.common.weights import cached, weights_named
from ico3d.errors import MissingExtraError, MissingModelError

PLAIN, QUANTISED = "qwen2", "qwen2-awq"
"""Names in the table of weights: full precision, and quantised (AWQ)."""
PACKAGES = ("transformers", "torch")
KERNELS = "gptqmodel"
"""Package that transformers needs for AWQ weights."""
WEIGHTS = ("model.safetensors", "model.safetensors.index.json")


@dataclass(frozen=True)
class Settings:
    """Options of the language model `qwen`.

    Attributes:
        model: A folder as a path (`./models/mine`, `/srv/mine`), or a name on the Hugging Face hub
            whose files are in its cache; empty for Qwen2-0.5B-Instruct, on CUDA in its AWQ form if
            installed.
        max_tokens: Highest number of tokens of an answer, thoughts included.
        temperature: Temperature of sampling, 0 to 2; the model's own if not given.
    """

    model: str = ""
    max_tokens: int = 200
    temperature: float | None = None

    def __post_init__(self):
        """Checks ranges.

        Raises:
            SettingsError: If an answer could have no words, or the temperature makes no sense.
        """
        check_sampling(self.temperature, self.max_tokens, {}, "chat settings: language 'qwen'")


def hindrance(settings: Settings) -> str:
    """A sentence on a missing package or missing weights, else empty."""
    missing = next(filter(None, (lacks_package(name, "qwen") for name in PACKAGES)), "")
    if missing or source(settings, cuda=False) is not None:
        return missing
    return f"its weights are not here: ico3d weights fetch {PLAIN}."


def detail(settings: Settings) -> str:
    """The model, as shown to visitors."""
    return Path(settings.model or weights_named(PLAIN).repository).name


def make(settings: Settings, context: Context) -> FrameProcessor:
    """Creates the language model of one session; the weights are loaded once for all sessions.

    Raises:
        MissingExtraError: If transformers or torch is not installed.
        MissingModelError: If the weights are not installed.
    """
    for name in PACKAGES:
        if find_spec(name) is None:
            raise MissingExtraError(name, "qwen", "the language model in this process")
    from ico3d.chat.services.language.hub.in_process import InProcessModel, load, on_cuda

    where = source(settings, on_cuda())
    if where is None:
        raise MissingModelError(
            f"the language model {settings.model or weights_named(PLAIN).repository} is not on "
            f"this machine: fetch it with `ico3d weights fetch {PLAIN}`, or give the path of its "
            "folder as 'model', such as ./models/mine."
        )
    return InProcessModel(
        load(where), instruction(context.persona), settings.max_tokens, settings.temperature
    )


def source(settings: Settings, cuda: bool) -> Path | None:
    """Folder of the model; None if its files are not installed."""
    quantised = [QUANTISED] if cuda and find_spec(KERNELS) else []
    folders = [cached(name) for name in (*quantised, PLAIN)]
    if settings.model:
        folders = [_named(settings.model)]
    return next((folder for folder in folders if folder and _is_whole(folder)), None)


def _named(model: str) -> Path | None:
    """The folder of a model that settings name.

    A name on the hub is none of a folder, wherever a server is started.
    """
    if model.startswith((".", "~")) or Path(model).is_absolute():
        return resolved(Path(model).expanduser())
    from huggingface_hub import try_to_load_from_cache
    from huggingface_hub.errors import HFValidationError

    try:
        found = try_to_load_from_cache(model, "config.json")
    except HFValidationError:  # neither a path nor a name
        return None
    return Path(found).parent if isinstance(found, str) else None


def _is_whole(folder: Path) -> bool:
    has_weights = any(os.path.isfile(folder / name) for name in WEIGHTS)
    return has_weights and os.path.isfile(folder / "config.json")
