"""Optional packages that several readers need."""

from types import ModuleType

from ico3d.errors import MissingExtraError


def opencv(purpose: str) -> ModuleType:
    """The module cv2.

    Args:
        purpose: What needs the package; the error begins with it.

    Raises:
        MissingExtraError: If it is not installed.
    """
    try:
        import cv2
    except ImportError:
        raise MissingExtraError("opencv-contrib-python", "body", purpose) from None
    return cv2


def hdf5(purpose: str) -> ModuleType:
    """The module h5py.

    Args:
        purpose: What needs the package; the error begins with it.

    Raises:
        MissingExtraError: If it is not installed.
    """
    try:
        import h5py
    except ImportError:
        raise MissingExtraError("h5py", "body", purpose) from None
    return h5py
