"""Settings of putting a head on a body."""

from dataclasses import dataclass

from ico3d.errors import SettingsError


@dataclass(frozen=True)
class JoiningSettings:
    """How a head is put on a body.

    Attributes:
        match_colors: Match the head's colours to the light in which the body was recorded.
        color_steps: Optimisation steps of matching the colours, with one picture each.
        color_rate: Learning rate of matching the colours.
        pruning: Remove the body's Gaussians from the face.
        border_points: Number of Gaussians near the border of head and body with which each window
            begins.
    """

    match_colors: bool = True
    color_steps: int = 800
    color_rate: float = 3e-2
    pruning: bool = True
    border_points: int = 400

    def __post_init__(self):
        """Checks the numbers.

        Raises:
            SettingsError: If a number is out of range.
        """
        if self.color_steps < 1 or not self.color_rate > 0 or self.border_points < 0:
            raise SettingsError(
                f"color_steps={self.color_steps}, color_rate={self.color_rate}, border_points="
                f"{self.border_points} are impossible: steps and rate are above 0, points not "
                "below; --joining.no-match-colors leaves the colours as they are."
            )
