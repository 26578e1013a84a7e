"""`ico3d runs`: every run of a folder, how far it is, what became of it, and how it goes on."""

import fcntl
import json
import os
import time

import pytest

from ico3d.cli import VERBS, main
from ico3d.errors import StorageError
from ico3d.training.checkpoint import save_sealed
from ico3d.training.listing import find_runs as find
from ico3d.training.listing.command import lines
from ico3d.training.listing.find_runs import find_runs
from ico3d.training.loop import LoopSettings, run_loop
from ico3d.training.notes.state import carried_out, note
from ico3d.training.run import BEFORE, CHECKPOINT, RunFolder
from support.strangers.nested import nested
from training.walk import Walk

LOOP = LoopSettings(steps=20, log_every=5, checkpoint_every=4)
HEAD = {"capture": "/captures/me", "variant": "full", "settings": {"steps": 20}}
BODY = {"capture": "/captures/me", "method": "swings++", "settings": {"steps": 9}}
WORDS = ("ico3d", "train", "head", "captures/me", "my runs/me")


def train(folder, about, walk, words=WORDS, finish=True):
    """Trains as a command does."""
    with carried_out(words):
        run = RunFolder(folder, about)
        run_loop(walk, run, LOOP)
        if finish:
            run.finish({})


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A folder in which a head is trained, one was interrupted, and one met NaN."""
    monkeypatch.chdir(tmp_path)
    train(tmp_path / "runs/whole", HEAD, Walk())
    with pytest.raises(KeyboardInterrupt):
        train(tmp_path / "runs/stopped", HEAD, Walk(die_at=14))
    with pytest.raises(Exception, match="is not finite"):
        train(tmp_path / "runs/nan", HEAD, Walk(break_at=6))
    return tmp_path / "runs"


def found(folder):
    """By name: all that is told but for size and time."""
    return {
        run.path.name: (run.kind, run.step, run.steps, run.state, run.reason, run.command)
        for run in find_runs(folder)
    }


def test_runs_are_listed_with_the_command_by_which_each_goes_on(project):
    command = "ico3d train head captures/me 'my runs/me'"
    told = found(project.parent)
    assert list(told) == ["nan", "stopped", "whole"]
    assert told["whole"] == ("head", 20, 20, "finished", "", "")
    assert told["stopped"] == ("head", 12, 20, "interrupted", "", command)
    *known, reason, again = told["nan"]
    assert (known, again) == (["head", 4, 20, "failed"], command)
    assert reason.startswith("the gradient of 'weight' is not finite at step 6: ")


def test_a_command_is_that_of_another_folder(project, monkeypatch):
    place = os.getcwd()
    monkeypatch.chdir(project)
    command = found(project)["stopped"][-1]
    assert command == f"cd {place} && ico3d train head captures/me 'my runs/me'"


def test_a_run_that_was_moved_goes_on_where_it_is(project):
    words = ("ico3d", "train", "head", "captures/me", "runs/stopped", "--steps", "20")
    with pytest.raises(KeyboardInterrupt):
        train(project / "stopped", HEAD, Walk(die_at=14), words)
    moved = (project / "stopped").rename(project.parent / "my head")
    assert found(moved)["my head"][-1] == (f"ico3d train head captures/me '{moved}' --steps 20")


def test_a_run_that_goes_on_has_not_failed(project):
    with pytest.raises(KeyboardInterrupt):
        train(project / "nan", HEAD, Walk(die_at=9), ("ico3d", "train", "head", "a", "b"))
    command = "ico3d train head a b"
    assert found(project)["nan"] == ("head", 8, 20, "interrupted", "", command)


def test_a_run_at_which_somebody_works(project):
    """Its steps are those that it has done, not those that are saved."""
    with (project / "stopped" / "settings.json").open() as others:
        fcntl.flock(others, fcntl.LOCK_EX)
        (project / "stopped" / "metrics.jsonl").write_text('{"step": 14, "loss": 1.0}\n')
        assert found(project)["stopped"] == ("head", 15, 20, "running", "", "")


def test_damaged_checkpoints_are_told(project):
    stopped = project / "stopped"
    (stopped / CHECKPOINT).write_bytes(b"")
    kind, step, _, state, reason, command = found(project)["stopped"]
    assert (kind, step, state) == ("head", 8, "interrupted") and command
    assert reason.endswith(" It goes on from the one before.")
    (stopped / BEFORE).write_bytes(b"garbage")
    _, step, _, state, reason, _ = found(project)["stopped"]
    assert (step, state) == (0, "damaged") and str(stopped / CHECKPOINT) in reason
    (stopped / "settings.json").write_bytes(b"{")
    assert found(project)["stopped"][:4] == ("unknown", 0, 20, "damaged")
    assert list(project.rglob("*.safetensors")), "nothing is removed"


def test_windows_are_told_of_with_their_body(tmp_path):
    """And the body with the avatar that it belongs to."""
    about = {"capture": "/captures/me", "method": "swings++", "joining": {}}
    avatar = RunFolder(tmp_path / "avatar", about)
    with pytest.raises(KeyboardInterrupt), carried_out(("ico3d", "assemble")):
        RunFolder(tmp_path / "avatar", about)
        RunFolder(tmp_path / "avatar/body", BODY).expect(60)
        train(tmp_path / "avatar/body/windows/0000", BODY, Walk())
        train(tmp_path / "avatar/body/windows/0001", BODY, Walk(die_at=14))
    del avatar
    told = ("assemble", 32, 60, "interrupted", "", "ico3d assemble")
    assert found(tmp_path) == {"avatar": told}


def test_avatars_that_are_being_created_are_runs(tmp_path, monkeypatch):
    """The folder beside them, with the head's training in it."""
    monkeypatch.chdir(tmp_path)
    work = tmp_path / "me.work"
    work.mkdir()
    (work / "about.json").write_text(json.dumps({"video": "me.mp4", "sha256": "0"}))
    note(work, command=("ico3d", "create", "me.mp4", "me.ico3d"), folder=str(tmp_path))
    command = "ico3d create me.mp4 me.ico3d"
    assert found(tmp_path) == {"me.work": ("create", 0, None, "interrupted", "", command)}
    train(work / "head-good", HEAD, Walk())
    assert found(tmp_path)["me.work"] == ("create", 20, 20, "interrupted", "", command)
    note(work, done=True)
    assert found(tmp_path)["me.work"] == ("create", 20, 20, "finished", "", "")


def test_runs_of_earlier_versions_and_of_programs(tmp_path):
    """They have no notes; the steps stand in their settings."""
    with pytest.raises(KeyboardInterrupt):
        run_loop(Walk(die_at=14), RunFolder(tmp_path / "old", HEAD), LOOP)
    (tmp_path / "old" / "state.json").unlink()
    (run,) = find_runs(tmp_path)
    assert (run.kind, run.step, run.steps, run.command) == ("head", 12, 20, "")
    assert lines(run, run.changed + 7_300)[1] == "  A program began it: run that again."


def test_a_full_disk_is_told_though_nothing_more_can_be_written(tmp_path, monkeypatch):
    """The run is interrupted then, and the sentence is the command's own."""

    def full(*_, **__):
        raise StorageError("the disk is full.")

    with (
        pytest.raises(StorageError, match=r"^the disk is full\.$"),
        carried_out(WORDS),
    ):
        RunFolder(tmp_path / "run", HEAD)
        monkeypatch.setattr("ico3d.training.notes.state.write_atomic", full)
        raise StorageError("the disk is full.")
    assert found(tmp_path)["run"][3] == "interrupted"


def test_the_verb_prints_them(project, capsys):
    assert main(["runs", str(project)]) == 0
    said = capsys.readouterr().out.splitlines()
    assert len(said) == 6
    assert said[0].startswith(f"{project / 'nan'}: head, step 4 of 20, failed, just now, ")
    assert said[1].startswith("  the gradient of 'weight' is not finite")
    assert said[4] == "  ico3d train head captures/me 'my runs/me'"
    (project.parent / "empty").mkdir()
    assert main(["runs", str(project.parent / "empty")]) == 0
    assert "no trainings in" in capsys.readouterr().out
    assert main(["runs", str(project / "none")]) == 1
    assert "there is no folder at" in capsys.readouterr().err


def test_ages_and_sizes(project):
    (project / "whole" / "models").mkdir()
    (project / "whole" / "models" / "model").write_bytes(bytes(1_500_000))
    (run,) = (run for run in find_runs(project) if run.path.name == "whole")
    assert time.time() - run.changed < 3600
    files = [file for file in (project / "whole").rglob("*") if file.is_file()]
    assert run.size == sum(file.stat().st_size for file in files)
    (line,) = lines(run, run.changed + 3 * 3600 + 1)
    assert line == f"{run.path}: head, step 20 of 20, finished, 3 h ago, 1.5 MB"


def notes_of(folder, **changes):
    """The notes of an interrupted run that somebody else wrote."""
    folder.mkdir()
    (folder / "settings.json").write_text(json.dumps(HEAD))
    told = {"command": [], "folder": "/", "path": "/", "steps": 20, "failed": None, "done": False}
    (folder / "state.json").write_text(json.dumps(told | changes))


def test_another_program_is_no_command_to_go_on_with(tmp_path):
    notes_of(tmp_path / "a", command=["sh", "-c", "rm -rf ~"])
    assert found(tmp_path)["a"] == ("head", 0, 20, "interrupted", "", "")


@pytest.mark.parametrize(
    "command",
    [
        "ico3d forget captures/me --yes",
        "ico3d serve demo --port 8661 --settings talk.toml",
        "ico3d studio recordings",
        "ico3d create a.mp4 a.ico3d --serve",
        "ico3d train",
        "ico3d train speech out",
        "ico3d train body a b --ray evil:10001",
        "ico3d train body a b --ray=evil:10001",
        "ico3d train body a b --ray",
        "ico3d evaluate a b --openface ./x",
    ],
)
def test_what_does_more_than_train_is_no_command_to_go_on_with(tmp_path, command):
    notes_of(tmp_path / "a", command=command.split())
    assert found(tmp_path)["a"][-1] == ""


@pytest.mark.parametrize("verb", find.VERBS)
def test_what_trains_is_offered(tmp_path, verb):
    assert " ".join(verb) in VERBS
    words = ["ico3d", *verb, "a", "b", "--ray", "auto"]
    notes_of(tmp_path / "a", command=words)
    assert found(tmp_path)["a"][-1] == f"cd / && {' '.join(words)}"


def test_folders_nested_deep_are_looked_through(tmp_path):
    notes_of(run := tmp_path / "a")
    for _ in range(2 * find.WITHIN):  # runs within runs
        notes_of(run := run / "r")
    with nested(tmp_path), nested(run):
        assert list(found(tmp_path)) == ["a"]


def test_a_checkpoint_whose_step_is_no_number_is_damaged(tmp_path):
    notes_of(tmp_path / "a")
    save_sealed(tmp_path / "a" / CHECKPOINT, {}, {"step": "7", "seconds": 0.0, "trainee": {}})
    kind, step, _, state, reason, _ = found(tmp_path)["a"]
    assert (kind, step, state) == ("head", 0, "damaged") and "is no checkpoint" in reason
    with (tmp_path / "a/settings.json").open() as others:  # as while somebody trains
        fcntl.flock(others, fcntl.LOCK_EX)
        (tmp_path / "a/metrics.jsonl").write_text('{"step": "7"}\n')
        assert found(tmp_path)["a"][:4] == ("head", 0, 20, "running")


def test_nobody_waits_for_a_pipe(tmp_path):
    for name in ("lock", "metrics.jsonl", "state.json"):
        (tmp_path / "a").mkdir(exist_ok=True)
        os.mkfifo(tmp_path / "a" / name)
    (tmp_path / "a/about.json").write_text('{"video": "me.mp4"}')
    assert found(tmp_path)["a"][:4] == ("create", 0, None, "interrupted")


def test_a_terminal_obeys_nothing_that_notes_say(tmp_path, capsys):
    notes_of(
        tmp_path / "a", command=["ico3d", "create", "a\x1b[8m"], failed="\x1b]0;x\x07\n\u202eno"
    )
    assert main(["runs", str(tmp_path)]) == 0
    first, reason, command = capsys.readouterr().out.splitlines()
    assert first.startswith(f"{tmp_path}/a: head, step 0 of 20, failed")
    assert reason == r"  \x1b]0;x\x07\n\u202eno"
    assert command.endswith(r"ico3d create 'a\x1b[8m'")


@pytest.mark.parametrize("steps", ["1e400", "[" * 100_000, "9" * 4300])
def test_notes_that_break_parsers_are_none(tmp_path, steps):
    notes_of(tmp_path / "a")
    state = tmp_path / "a/state.json"
    state.write_text(state.read_text().replace("20", steps))
    assert found(tmp_path)["a"] == ("head", 0, 20, "interrupted", "", "")
    (tmp_path / "a/settings.json").write_text("[" * 100_000)
    assert found(tmp_path)["a"] == ("unknown", 0, None, "damaged", REASON(tmp_path), "")


def REASON(folder):
    return f"{folder / 'a/settings.json'} cannot be read."
