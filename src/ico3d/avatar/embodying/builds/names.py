"""Names of builds."""

from typing import Literal

BuildName = Literal["slender", "medium", "sturdy"]
MEDIUM: BuildName = "medium"
"""The build of a body as it was recorded."""
