"""Optional packages that several readers need."""

from importlib import import_module
from types import ModuleType

from ico3d.errors import MissingExtraError


def opencv(purpose: str) -> ModuleType:
    """The module cv2; arguments and errors as of `hdf5`."""
    return _optional("cv2", "opencv-contrib-python", purpose)


def hdf5(purpose: str) -> ModuleType:
    """The module h5py.

    Args:
        purpose: What needs the package; the error begins with it.

    Raises:
        MissingExtraError: If it is not installed.
    """
    return _optional("h5py", "h5py", purpose)


def _optional(module: str, package: str, purpose: str) -> ModuleType:
    try:
        return import_module(module)
    except ImportError:
        raise MissingExtraError(package, "body", purpose) from None
