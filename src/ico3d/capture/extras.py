"""Optional packages that several readers need."""

from importlib import import_module
from types import ModuleType

from ico3d.errors import MissingExtraError


def opencv(purpose: str) -> ModuleType:
    """Imports the module cv2; argument and errors as for `hdf5`."""
    return _optional("cv2", "opencv-contrib-python", purpose)


def hdf5(purpose: str) -> ModuleType:
    """Imports the module h5py.

    Args:
        purpose: What needs the package, at the start of the error sentence.

    Raises:
        MissingExtraError: If the package is not installed.
    """
    return _optional("h5py", "h5py", purpose)


def _optional(module: str, package: str, purpose: str) -> ModuleType:
    try:
        return import_module(module)
    except ImportError:
        raise MissingExtraError(package, "body", purpose) from None
