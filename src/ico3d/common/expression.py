"""The names of the values that drive a head beside its adapted speech features."""

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
