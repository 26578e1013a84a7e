"""The voice that was cloned for an avatar: the file in its bundle."""

import numpy as np

from ico3d.bundle.tensors import Spec, decode_tensors, encode_tensors

VOICE = "voice.safetensors"
SIZE = 256
"""Number of values of a tone colour of OpenVoice V2."""
_KEY = "tone_colour"
_SPEC: Spec = {_KEY: ("F32", (SIZE,))}


def voice_to_bytes(tone: np.ndarray) -> bytes:
    """The file of a tone colour, (256,) float32.

    Raises:
        BundleError: If it has another shape, or a value that is not finite.
    """
    return encode_tensors({_KEY: tone}, _SPEC, VOICE)


def voice_from_bytes(data: bytes) -> np.ndarray:
    """The tone colour (256,) float32 in a file.

    Raises:
        BundleError: If the file is malformed, or holds a value that is not finite.
    """
    return decode_tensors(data, _SPEC, VOICE)[_KEY]
