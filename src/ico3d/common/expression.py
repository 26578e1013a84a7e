"""What the expression vector of a speech-driven head holds: speech values, then eye values."""

SPEECH_SIZE = 32
"""How many adapted speech features come first."""

EYE_NAMES = (
    "browDownLeft",
    "browDownRight",
    "browInnerUp",
    "browOuterUpLeft",
    "browOuterUpRight",
    "eyeBlinkLeft",
    "eyeBlinkRight",
)
"""The seven eye and brow values that complete the expression vector (ARKit names, 0 to 1)."""
