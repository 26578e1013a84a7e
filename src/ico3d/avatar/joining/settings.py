"""Settings of putting a head on a body."""

from dataclasses import dataclass

from ico3d.errors import SettingsError


@dataclass(frozen=True)
class JoiningSettings:
    """How a head is put on a body.

    Attributes:
        match_colors: Match the head's colours to the light in which the body was recorded.
        pruning: Remove the body's Gaussians from the face.
        border_points: Number of Gaussians near the border of head and body with which each window
            begins.
    """

    match_colors: bool = True
    pruning: bool = True
    border_points: int = 400

    def __post_init__(self):
        """Checks the numbers.

        Raises:
            SettingsError: If a number is out of range.
        """
        if self.border_points < 0:
            raise SettingsError(
                f"border_points={self.border_points} is impossible: it is 0 or more."
            )
