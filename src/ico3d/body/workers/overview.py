"""How far windows are that train elsewhere, in one view.

It reads the metrics that each leaves in its folder: whoever trains need not be asked, on whatever
machine they are.
"""

from collections.abc import Sequence

from ico3d.body.training.train_clip import WindowTask
from ico3d.training.log import latest_entry, progress_bar, readable


class Overview:
    """A bar for all windows and one for each that is not done; drawn while entered."""

    def __init__(self, tasks: Sequence[WindowTask]):
        """Looks how far the windows are."""
        self._tasks, self._bars = tasks, progress_bar()
        self._done = {task.index: _standing(task)[0] for task in tasks}
        steps = sum(task.steps for task in tasks)
        self._all = self._bars.add_task(
            "all windows", total=steps, completed=sum(self._done.values()), numbers=""
        )
        self._rows = {
            task.index: self._bars.add_task(
                task.label,
                total=task.steps,
                completed=self._done[task.index],
                visible=self._done[task.index] < task.steps,
                numbers="",
            )
            for task in tasks
        }

    def __enter__(self) -> "Overview":
        """Begins to draw."""
        self._bars.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Ends drawing."""
        self._bars.stop()

    def say(self, sentence: str) -> None:
        """Prints above the bars."""
        self._bars.console.print(sentence, markup=False, highlight=False, soft_wrap=True)

    def refresh(self) -> None:
        """Looks again."""
        for task in self._tasks:
            done, numbers = _standing(task)
            if done != self._done[task.index]:
                self._move(task, done, numbers)
        self._bars.update(self._all, completed=sum(self._done.values()))

    def _move(self, task: WindowTask, done: int, numbers: str) -> None:
        """Moves a window's bar; one that is done becomes a line."""
        row = self._rows[task.index]
        if done < self._done[task.index]:  # from a checkpoint: its speed is measured anew
            self._bars.reset(row)
        self._done[task.index] = done
        self._bars.update(row, completed=done, numbers=numbers, visible=done < task.steps)
        if done == task.steps:
            self.say(f"{task.label}: {numbers}")


def _standing(task: WindowTask) -> tuple[int, str]:
    """Steps that a window has done, and its numbers."""
    entry = latest_entry(task.folder)
    if entry is None:
        return 0, ""
    done = entry.pop("step") + 1
    return done, readable(entry)
