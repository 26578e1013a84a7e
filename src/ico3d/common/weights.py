"""Weights that ico3d can use and does not ship: what they are, where they come from and lie.

The facts are in `TABLE` and nowhere else. Nothing is downloaded unless the user says
`ico3d weights fetch NAME`.
"""

import os
from dataclasses import dataclass
from pathlib import Path

from ico3d.errors import MissingModelError, SettingsError


@dataclass(frozen=True)
class RemoteFile:
    """One file of some weights.

    Attributes:
        name: How it is called here.
        url: Where it is downloaded from.
        sha256: Of what is downloaded, in hexadecimal; its first digits where no more is known
            (PyTorch puts eight of them into its file names); empty where nothing is known.
        git_blob: Its id in the git repository it comes from, instead.
        keep: Prefix of the tensors that are kept where a PyTorch file becomes safetensors.
    """

    name: str
    url: str
    sha256: str = ""
    git_blob: str = ""
    keep: str = ""


@dataclass(frozen=True)
class Weights:
    """Weights under one name: some files, or a repository of the Hugging Face hub.

    Attributes:
        name: What the user calls them.
        purpose: What needs them.
        size: Bytes to download, to about two digits.
        licence: By its usual name.
        files: To download one by one; the first one stands for all.
        repository: `owner/name` on the hub, instead.
        wanted: Which of the repository's files, as patterns; the first one must be there.
        notice: What the licence forbids, one sentence; who fetches them is asked to agree.
    """

    name: str
    purpose: str
    size: int
    licence: str
    files: tuple[RemoteFile, ...] = ()
    repository: str = ""
    wanted: tuple[str, ...] = ()
    notice: str = ""

    @property
    def source(self) -> str:
        """Where they come from, for people."""
        return f"huggingface.co/{self.repository}" if self.repository else self.files[0].url

    @property
    def checked_by(self) -> str:
        """How a download is checked, for people.

        By the hub's own client, by a checksum, or, where none is known, by its length and by how
        files of its kind begin.
        """
        if self.repository:
            return "hub"
        if all(file.sha256 or file.git_blob for file in self.files):
            return "git blob id" if self.files[0].git_blob else "sha256"
        return "length"


_TORCH = "https://download.pytorch.org/models"
_KOKORO = "https://github.com/thewh1teagle/kokoro-onnx/releases/download/model-files-v1.0"
_MEDIAPIPE = "https://storage.googleapis.com/mediapipe-models"
_LANGUAGES = ("English", "Spanish", "French", "Chinese", "Japanese", "Korean")
_MB = 10**6

TABLE: dict[str, Weights] = {
    weights.name: weights
    for weights in (
        Weights(
            "face-landmarker",
            "finding faces (MediaPipe)",
            3_758_596,
            "Apache-2.0",
            (
                RemoteFile(
                    "face_landmarker.task",
                    f"{_MEDIAPIPE}/face_landmarker/face_landmarker/float16/1/face_landmarker.task",
                    "64184e229b263107bc2b804c6625db1341ff2bb731874b0bcc2fe6544e0bc9ff",
                ),
            ),
        ),
        Weights(
            "pose-landmarker",
            "finding a body's joints (MediaPipe, full)",
            9_398_198,
            "Apache-2.0",
            (
                RemoteFile(
                    "pose_landmarker.task",
                    f"{_MEDIAPIPE}/pose_landmarker/pose_landmarker_full/float16/1/"
                    "pose_landmarker_full.task",
                ),
            ),
        ),
        Weights(
            "hand-landmarker",
            "finding hands' joints (MediaPipe)",
            7_819_105,
            "Apache-2.0",
            (
                RemoteFile(
                    "hand_landmarker.task",
                    f"{_MEDIAPIPE}/hand_landmarker/hand_landmarker/float16/1/hand_landmarker.task",
                ),
            ),
        ),
        Weights(
            "ave",
            "speech encoder 'ave' (SyncTalk's)",
            11 * _MB,
            "CC BY-NC 4.0",
            (
                RemoteFile(
                    "audio_visual_encoder.pth",
                    "https://github.com/ZiqiaoPeng/SyncTalk/raw/main/"
                    "nerf_triplane/checkpoints/audio_visual_encoder.pth",
                    git_blob="9fe9b655c3f952f26f0353a468ab33ff78c0bdf3",
                ),
            ),
            notice="SyncTalk's audio-visual encoder is licensed CC BY-NC 4.0: "
            "avatars that use it are for non-commercial purposes.",
        ),
        Weights(
            "hubert",
            "speech encoder 'hubert' (HuBERT large)",
            1260 * _MB,
            "Apache-2.0",
            repository="facebook/hubert-large-ls960-ft",
            wanted=("config.json", "pytorch_model.bin", "model.safetensors"),
        ),
        Weights(
            "vgg16",
            "perceptual loss, LPIPS",
            553 * _MB,
            "BSD-3-Clause",
            (
                RemoteFile(
                    "vgg16.safetensors",
                    f"{_TORCH}/vgg16-397923af.pth",
                    "397923af",
                    keep="features.",
                ),
            ),
        ),
        Weights(
            "lpips",
            "LPIPS 0.1 (with vgg16)",
            7_000,
            "BSD-2-Clause",
            (
                RemoteFile(
                    "lpips_vgg.safetensors",
                    "https://github.com/richzhang/PerceptualSimilarity/raw/master/"
                    "lpips/weights/v0.1/vgg.pth",
                    keep="lin",
                ),
            ),
        ),
        Weights(
            "raft",
            "optical flow (with torchvision)",
            21 * _MB,
            "BSD-3-Clause",
            (
                RemoteFile(
                    "raft_large_C_T_SKHT_V2-ff5fadd5.pth",
                    f"{_TORCH}/raft_large_C_T_SKHT_V2-ff5fadd5.pth",
                    "ff5fadd5",
                ),
            ),
        ),
        Weights(
            "whisper-large-v3",
            "recognition, 99 languages",
            3100 * _MB,
            "MIT",
            repository="Systran/faster-whisper-large-v3",
            wanted=("model.bin", "*.json"),
        ),
        Weights(
            "distil-large-v3",
            "recognition, English, faster",
            1510 * _MB,
            "MIT",
            repository="Systran/faster-distil-whisper-large-v3",
            wanted=("model.bin", "*.json"),
        ),
        *(
            Weights(
                f"whisper-{model}",
                f"recognition, 99 languages, {remark}",
                size * _MB,
                "MIT",
                repository=f"{owner}/faster-whisper-{model}",
                wanted=("model.bin", "*.json", "vocabulary.*"),
            )
            for model, remark, size, owner in (
                ("large-v3-turbo", "faster", 1620, "mobiuslabsgmbh"),
                ("small", "smaller", 484, "Systran"),
                ("base", "for a CPU", 145, "Systran"),
                ("tiny", "for a slow CPU", 76, "Systran"),
            )
        ),
        Weights(
            "qwen2",
            "language model in process, CPU",
            1000 * _MB,
            "Apache-2.0",
            repository="Qwen/Qwen2-0.5B-Instruct",
            wanted=("model.safetensors", "*.json", "merges.txt"),
        ),
        Weights(
            "qwen2-awq",
            "language model in process, CUDA",
            730 * _MB,
            "Apache-2.0",
            repository="Qwen/Qwen2-0.5B-Instruct-AWQ",
            wanted=("model.safetensors", "*.json", "merges.txt"),
        ),
        Weights(
            "openvoice",
            "voice: OpenVoice V2's tone colour",
            131 * _MB,
            "MIT",
            repository="myshell-ai/OpenVoiceV2",
            wanted=("converter/checkpoint.pth", "converter/config.json", "base_speakers/*"),
        ),
        *(
            Weights(
                f"melotts-{language.lower()}",
                f"voice: OpenVoice V2's base, {language}",
                208 * _MB,
                "MIT",
                repository=f"myshell-ai/MeloTTS-{language}",
                wanted=("checkpoint.pth", "config.json"),
            )
            for language in _LANGUAGES
        ),
        Weights(
            "kokoro",
            "voice: Kokoro",
            338 * _MB,
            "Apache-2.0",
            (
                RemoteFile("kokoro-v1.0.onnx", f"{_KOKORO}/kokoro-v1.0.onnx"),
                RemoteFile("voices-v1.0.bin", f"{_KOKORO}/voices-v1.0.bin"),
            ),
        ),
    )
}


def weights_named(name: str) -> Weights:
    """An entry of the table.

    Raises:
        SettingsError: If there is none of this name.
    """
    if name not in TABLE:
        raise SettingsError(f"there are no weights '{name}': choose from {', '.join(TABLE)}.")
    return TABLE[name]


def model_folders() -> list[Path]:
    """Where weights are looked for: `$ICO3D_MODELS`, then the user's cache, where fetched ones go.

    The last one, `~/.cache/ico3d/models`, is the one to write to.
    """
    folders = [Path(p) for p in (os.environ.get("ICO3D_MODELS"),) if p]
    return [*folders, Path.home() / ".cache" / "ico3d" / "models"]


def find_model(name: str) -> Path | None:
    """A file or folder by its name in the folders of weights; None where it lies in neither."""
    places = (folder / name for folder in model_folders())
    return next((place for place in places if place.exists()), None)


def cached(name: str) -> Path | None:
    """Where weights of the table lie on this machine; nothing is downloaded.

    Args:
        name: A key of `TABLE`.

    Returns:
        The file; for several files or a repository their folder (a copy named like the
        repository's last part in a folder of weights counts); None where they are not there.

    Raises:
        SettingsError: If the table has no such weights.
    """
    weights = weights_named(name)
    if weights.repository:
        return _repository_folder(weights)
    for folder in model_folders():
        if all((folder / file.name).is_file() for file in weights.files):
            return folder / weights.files[0].name if len(weights.files) == 1 else folder
    return None


def model_file(name: str, purpose: str) -> Path:
    """Finds a model file in the folders of weights.

    Args:
        name: The file.
        purpose: What needs it, for the error.

    Raises:
        MissingModelError: If it lies in none of them; the sentence says how to get it.
    """
    found = find_model(name)
    if found is not None:
        return found
    raise MissingModelError(f"{purpose} needs the model file '{name}': {how_to_get(name)}")


def model_of(name: str) -> Path:
    """Where weights of the table lie.

    Raises:
        MissingModelError: If they are not on this machine; the sentence says how to get them.
    """
    found = cached(name)
    if found is None:
        weights = weights_named(name)
        raise MissingModelError(
            f"the weights '{name}' are not here: fetch them with ico3d weights fetch {name} "
            f"({weights.licence}), or put a copy of {weights.source} into {model_folders()[-1]}."
        )
    return found


def how_to_get(file: str) -> str:
    """The end of a sentence that says where a missing file comes from."""
    place = (
        f"put it into {model_folders()[-1]} or name its folder in the environment variable "
        "ICO3D_MODELS."
    )
    for weights in TABLE.values():
        if any(entry.name == file for entry in weights.files):
            verb = f"ico3d weights fetch {weights.name}"
            return f"fetch it with {verb} ({weights.licence}), or {place}"
    return place


def _repository_folder(weights: Weights) -> Path | None:
    """A repository's files, in a folder of weights or in the hub's cache."""
    must = weights.wanted[0]
    own = find_model(weights.repository.split("/")[-1])
    if own is not None and (own / must).is_file():
        return own
    try:
        from huggingface_hub import try_to_load_from_cache
    except ImportError:
        return None
    found = try_to_load_from_cache(weights.repository, must)
    return Path(found).parents[must.count("/")] if isinstance(found, str) else None
