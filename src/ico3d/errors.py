"""Errors that a user can cause. Each carries one clear sentence: what, where, what to do."""

from collections.abc import Mapping
from typing import Self

from ico3d.failures import FAILURES

MOST_LETTERS = 1000
"""Length of a sentence, beyond which its middle is left out."""


class Ico3dError(Exception):
    """Base of every error the command line prints as one sentence, without a traceback.

    Attributes:
        code: Name of what happened in `FAILURES`, by which a page finds it in its own languages;
            empty where it has no name.
        values: What stands in that text, by its name there.
    """

    code: str = ""
    values: Mapping[str, float | str] = {}

    @classmethod
    def of(
        cls, code: str, before: str = "", after: str = "", values: Mapping[str, float | str] = {}
    ) -> Self:
        """An error that a page can tell in its own languages.

        Args:
            code: Name of its text in `FAILURES`.
            before: What a terminal shows before that text, such as the name of a file.
            after: What a terminal shows behind it.
            values: What stands in the text.
        """
        error = cls(f"{before}{FAILURES[code].format(**values)}{after}")
        error.code, error.values = code, values
        return error

    def __str__(self) -> str:
        """The sentence, on one line, of bounded length, without characters that a terminal obeys.

        Sentences quote names and values from files that anybody may have made.
        """
        shown = printable(super().__str__())
        if len(shown) <= MOST_LETTERS:
            return shown
        return f"{shown[: MOST_LETTERS // 2]} … {shown[-MOST_LETTERS // 2 :]}"

    def __reduce__(self):
        """Travels between processes as its sentence, whatever its constructor takes."""
        return _again, (type(self), self.args), self.__dict__


def printable(text: str) -> str:
    """A text on one line, with escapes in the place of characters that a terminal obeys.

    What stands in others' files, and names of these, is printed by this.
    """
    return text if text.isprintable() else "".join(map(_shown, text))


def _shown(character: str) -> str:
    """A character as it is, or as its escape where it is no printable one."""
    return character if character.isprintable() else ascii(character)[1:-1]


def _again(kind: type[Ico3dError], words: tuple) -> Ico3dError:
    """An error that has travelled."""
    return kind.__new__(kind, *words)


class CaptureError(Ico3dError):
    """A recording is missing, damaged or inconsistent."""


class ModelError(Ico3dError):
    """A trained model or checkpoint cannot be used."""


class BundleError(Ico3dError):
    """A bundle is damaged, unsafe, or of an unknown version."""


class GaussianFileError(Ico3dError):
    """A file of 3D Gaussians is damaged, unknown or cannot be written."""


class SettingsError(Ico3dError):
    """Settings contradict one another or the data."""


class StorageError(Ico3dError):
    """A disk is full."""


class DeviceError(Ico3dError):
    """A GPU failed while it computed."""


class ProtocolError(Ico3dError):
    """A message on the wire is malformed or over its limits."""


class DiagnosisError(Ico3dError):
    """A machine or a deployment has something to mend."""


class ServiceError(Ico3dError):
    """A service of the conversation failed at its job."""


class MissingExtraError(Ico3dError):
    """An optional package is needed and not installed."""

    def __init__(self, package: str, extra: str, purpose: str):
        """Names the package, the extra that brings it, and what it is needed for."""
        super().__init__(
            f"{purpose} needs the package '{package}': "
            f"install it with pip install 'ico3d[{extra}]'."
        )


class MissingModelError(Ico3dError):
    """A model file (weights) is needed and not there."""


class DownloadError(Ico3dError):
    """A download failed, or is not what it should be."""
