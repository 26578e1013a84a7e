"""How long the rest of a making takes: as planned at first, then as fast as its steps really go."""

from collections.abc import Mapping

from ico3d.creating.events import STEPS, Step

EVEN: tuple[Step, ...] = ("learn", "measure")
"""Steps whose parts take equally long, so that a fifth of them tells of the rest."""
TOLD_BY = 0.2
"""Share of such a step from which on its own pace is believed and not the plan."""


class Estimate:
    """The seconds that are left, from a plan and from the steps as they advance."""

    def __init__(self, plan: Mapping[Step, float]):
        """Takes the planned seconds of each step; a step that is not in it takes none."""
        self._plan = dict(plan)
        self._step: Step | None = None
        self._began, self._first = 0.0, 0.0
        self._slower = 1.0  # how many times as long as planned steps take

    def left(self, step: Step, share: float, now: float) -> float:
        """Expected seconds of all that is left.

        Args:
            step: The step that goes on.
            share: How much of it is done, 0 to 1.
            now: The time in seconds.
        """
        if step != self._step:
            self._step, self._began, self._first = step, now, share
        planned = self._plan.get(step, 0.0)
        whole = self._whole(planned, share - self._first, now - self._began)
        if step in EVEN and planned:
            self._slower = whole / planned
        return whole * (1 - share) + self.later(step)

    def later(self, step: Step) -> float:
        """Expected seconds of the steps after one."""
        after = STEPS[STEPS.index(step) + 1 :]
        return sum(self._plan.get(one, 0.0) for one in after) * self._slower

    def _whole(self, planned: float, done: float, seconds: float) -> float:
        """Expected seconds of a whole step, a part of which was seen to take some seconds."""
        if not planned or done <= 0:
            return planned * self._slower
        trust = min(done / TOLD_BY, 1.0) if self._step in EVEN else done
        return planned * (1 - trust) + seconds / done * trust
