"""Shows the progress of windows that are trained by other processes or machines.

Progress is read from the metrics that each window's training writes into its folder, so workers
need not be asked.
"""

from collections.abc import Sequence

from ico3d.body.training.train_clip import WindowTask
from ico3d.training.log import latest_entry, progress_bar, readable


class Overview:
    """A context that draws a progress bar for all windows, and one for each unfinished window."""

    def __init__(self, tasks: Sequence[WindowTask]):
        """Makes the bars, with the progress that the windows' folders show."""
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
        """Begins to draw the bars."""
        self._bars.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Ends drawing the bars."""
        self._bars.stop()

    def say(self, sentence: str) -> None:
        """Prints a sentence above the bars."""
        self._bars.console.print(sentence, markup=False, highlight=False, soft_wrap=True)

    def refresh(self) -> None:
        """Reads the windows' progress again and moves the bars."""
        for task in self._tasks:
            done, numbers = _standing(task)
            if done != self._done[task.index]:
                self._move(task, done, numbers)
        self._bars.update(self._all, completed=sum(self._done.values()))

    def _move(self, task: WindowTask, done: int, numbers: str) -> None:
        """Moves a window's bar; the bar of a finished window is replaced by a printed line."""
        row = self._rows[task.index]
        if done < self._done[task.index]:  # back to a checkpoint: measure its speed anew
            self._bars.reset(row)
        self._done[task.index] = done
        self._bars.update(row, completed=done, numbers=numbers, visible=done < task.steps)
        if done == task.steps:
            self.say(f"{task.label}: {numbers}")


def _standing(task: WindowTask) -> tuple[int, str]:
    """Number of steps that a window has done, and its latest metrics in words."""
    entry = latest_entry(task.folder)
    if entry is None:
        return 0, ""
    done = entry.pop("step") + 1
    return done, readable(entry)
