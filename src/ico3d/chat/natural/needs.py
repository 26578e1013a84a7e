"""What the natural conversation needs besides a server's packages, and what of it is missing."""

import re
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import ico3d
from ico3d.common.catalogue.kinds import FilesPackage
from ico3d.common.weights import cached, weights_named

SETTINGS = Path(ico3d.__file__).parent / "chat" / "data" / "natural.toml"
"""Settings file that chooses the services."""


@dataclass(frozen=True)
class Need:
    """Something that is downloaded.

    Attributes:
        name: Name of the package or of the weights.
        purpose: What it is for.
        size: Size of the download in bytes, for a package with what it needs itself.
        licence: The licence's usual name.
        version: The version to install; empty for weights.
    """

    name: str
    purpose: str
    size: int
    licence: str
    version: str = ""


PACKAGES = (
    Need("faster-whisper", "recognition", 43_000_000, "MIT", "1.2.1"),
    Need("ctranslate2", "runs recognition and language model", 43_000_000, "MIT", "4.8.5"),
    Need("gguf", "reads the language model", 1_000_000, "MIT", "0.19.0"),
    Need("hibari-tts", "voice, female, with its model", 14_000_000, "Apache-2.0", "0.2.1"),
)
"""Packages of the extra `natural`, with the versions that the tests ran with."""
WEIGHTS = ("whisper-tiny.en", "smollm2-135m")
"""Names of the weights in the catalogue."""


def missing_packages() -> list[Need]:
    """The packages that are not installed in any version, or in an older one."""
    return [need for need in PACKAGES if _installed(need.name) < _numbers(need.version)]


def missing_weights() -> list[Need]:
    """The weights that are not on this machine."""
    absent = [weights_named(name) for name in WEIGHTS if cached(name) is None]
    return [
        Need(w.name, w.purpose, w.package.size, w.licence)
        for w in absent
        if isinstance(w.package, FilesPackage)
    ]


def _installed(package: str) -> tuple[int, ...]:
    """Version of an installed package; empty if there is none."""
    try:
        return _numbers(version(package))
    except PackageNotFoundError:
        return ()


def _numbers(text: str) -> tuple[int, ...]:
    """The numbers of a version."""
    return tuple(int(number) for number in re.findall(r"\d+", text))
