"""The command line: verbs and their groups, every setting an option, presets in --help."""

import os
import re
import subprocess
import sys
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path

import pytest
import tyro

from ico3d import cli
from ico3d.body.settings import BodySettings
from ico3d.errors import CaptureError
from ico3d.head.settings import PRESETS, HeadSettings, Network
from ico3d.scene.settings import SceneSettings
from ico3d.speech.training.settings import EncoderSettings

pytestmark = pytest.mark.slow

SETTINGS = {
    "train head": HeadSettings,
    "train body": BodySettings,
    "train static": SceneSettings,
    "train speech": EncoderSettings,
    "assemble": BodySettings,
    "measure body": BodySettings,
}
PLACES = ["capture", "out"]


@pytest.fixture
def shown(capsys, monkeypatch):
    """What a command prints at 100 columns, without frames and on one line; it must end so."""
    monkeypatch.setenv("COLUMNS", "100")

    def show(words: str, status: int = 0) -> str:
        try:
            ended = cli.main(words.split())
        except SystemExit as end:
            ended = end.code
        assert ended == status
        said = capsys.readouterr()
        return " ".join(re.sub("[│╭╮╰╯─]", " ", said.out + said.err).split())

    return show


def options(kind, prefix=""):
    """Name and documentation of every setting, by the option that it must be."""
    for field in fields(kind):
        name = prefix + field.name.replace("_", "-")
        told = re.search(rf"^ {{8}}{field.name}: (\S+ \S+)", kind.__doc__, re.MULTILINE)
        assert told is not None, f"{kind.__name__} does not say what {field.name} is"
        if is_dataclass(field.default):
            yield from options(type(field.default), f"{name}.")
        else:
            yield f"--{name}", told[1]


@pytest.mark.parametrize("verb", SETTINGS)
def test_every_setting_is_an_option_that_is_explained(shown, verb):
    text = shown(f"{verb} --help")
    for option, told in options(SETTINGS[verb]):
        assert re.search(rf"{option}(, --\S+)?( \S+)? {re.escape(told)}", text), option


def test_help_shows_the_defaults_of_the_chosen_preset(shown):
    steps = r"--steps INT Optimisation steps, one picture each\. \(default: (\d+)\)"
    torso = r"--loss\.torso FLOAT [^(]*\(default: ([\d.]+)\)"
    for preset, settings in PRESETS.items():
        text = shown(f"train head --help --preset {preset}")
        assert re.findall(steps, text) == [str(settings.steps)]
        assert re.findall(torso, text) == [str(settings.loss.torso)]
    assert "--mlp.depth INT Number of hidden layers. (default: 4)" in shown(
        "train body --method swings --help"
    )
    assert "--steps INT Optimisation steps of a window, one picture each. (default: 716)" in shown(
        "assemble --body somewhere --help"
    )


def test_options_change_the_preset_and_nothing_else():
    words = "--preset paper --steps 7 --rates.basis 0.5 --optimiser sgd --compile"
    paper = PRESETS["paper"]
    settings = cli.parsed("train head", [*PLACES, *words.split(), "--network.hidden", "9"]).settings
    assert (settings.steps, settings.rates.basis, settings.optimiser) == (7, 0.5, "sgd")
    assert settings.compile and not settings.mixed_precision
    assert settings.network == Network(hidden=9)
    assert (settings.loss, settings.density) == (paper.loss, paper.density)
    assert cli.parsed("train head", PLACES).settings == PRESETS["cpu"]
    with_equals = cli.parsed("train head", ["--preset=paper", *PLACES, "--no-compile"]).settings
    assert with_equals == paper


@pytest.mark.parametrize("preset", ["cpu", "paper"])
def test_presets_depend_on_method_and_strategy(preset):
    def parsed(verb, *words):
        return cli.parsed(verb, [*PLACES, "--preset", preset, *words]).settings

    ours, swings, fourd = (
        parsed("train body", "--method", method) for method in ("swings++", "swings", "4dgs")
    )
    assert (ours.mlp.depth, swings.mlp.depth, fourd.mlp.sets) == (2, 4, 1)
    assert parsed("train body", "--method", "swings", "--mlp.depth", "3").mlp.depth == 3
    skinned, hugs = (parsed("train body", "--method", name) for name in ("skinned", "hugs"))
    assert (skinned.skinning.shapes, skinned.skinning.light) == (8, True)
    assert (hugs.skinning.shapes, hugs.skinning.light) == (0, False)
    assert skinned.rates == hugs.rates and skinned.steps_of(100) >= ours.steps_of(100)
    default, mcmc = (parsed("train static", "--strategy", name) for name in ("default", "mcmc"))
    assert (default.initial.opacity, mcmc.initial.opacity) == (0.1, 0.5)
    assert mcmc.density.until > default.density.until
    assert mcmc.rates == default.rates and mcmc.mcmc == default.mcmc


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--steps x", "Error parsing --steps: invalid literal for int() with base 10: 'x'"),
        ("--loss.alpah 1", "Perhaps you meant: --loss.alpha FLOAT"),
        ("--stepz 7", "Perhaps you meant: --steps INT"),
        ("--optimiser lion", "invalid choice 'lion' for argument '--optimiser'. Expected one of"),
        ("--preset papr", "invalid choice 'papr' for argument '--preset'. Expected one of"),
        ("--compile=yes", "Unrecognized options: yes"),
    ],
)
def test_what_is_wrong_is_said(shown, words, said):
    assert said in shown(f"train head capture out {words}", status=2)


@dataclass(frozen=True)
class Script:
    """What a script of its own measures.

    Attributes:
        capture: Where the recording lies.
    """

    capture: tyro.conf.Positional[Path]

    def run(self) -> None:
        raise CaptureError(f"there is no capture at {self.capture}.")


def test_a_script_says_what_it_measures_and_what_is_wrong_as_verbs_do(capsys, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["bench/script.py", "nowhere"])
    assert cli.run_script(Script) == 1
    assert capsys.readouterr().err == "ico3d: there is no capture at nowhere.\n"
    monkeypatch.setattr(sys, "argv", ["bench/script.py", "--help"])
    with pytest.raises(SystemExit):
        cli.run_script(Script)
    told = capsys.readouterr().out
    assert "bench/script.py [-h] CAPTURE" in told and __doc__ is not None
    assert __doc__ in told and "Where the recording lies." in told


def test_a_group_lists_its_verbs(shown):
    for words in ("train", "train --help", "train -h"):
        text = shown(words)
        assert all(verb in text for verb in SETTINGS if verb.startswith("train "))
        assert "capture" not in text.replace("on a capture", "")
    everything = shown("")
    assert everything == shown("--help") and all(verb in everything for verb in cli.VERBS)


def test_a_verb_that_is_none_is_named(shown):
    text = shown("train heads --steps 3", status=2)
    assert text.startswith("ico3d: no such verb: train heads") and "train head" in text
    assert "measure body" not in text
    assert "no such verb: trian head" in shown("trian head", status=2)


def test_help_is_quick():
    """No verb needs anything heavy to say what its settings are."""
    program = """
import sys
from ico3d import cli
for verb in cli.VERBS:
    try:
        cli.main([*verb.split(), "--help"])
    except SystemExit as end:
        assert end.code == 0, verb
heavy = {"torch", "numba", "scipy", "pipecat", "onnxruntime", "numpy"} & set(sys.modules)
assert not heavy, heavy
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


MEMORY = """
import sys
import numpy, torch
from ico3d import cli
from ico3d.common.unpacking import limits

class Takes:
    def run(self):
        print(len(TAKEN))

limits.LEAST_BYTES, limits.free_memory = 32 << 20, lambda: 128 << 20
cli.parsed = lambda verb, words: Takes()
sys.argv = ["ico3d", VERB, "x"]
sys.exit(cli.main())
"""


@pytest.mark.parametrize("taken", ["numpy.ones(1 << 25)", "torch.ones(1 << 26)"])
def test_a_command_takes_no_more_memory_than_is_free(taken):
    """Whichever library asks for it: a stranger's file ends the command, and nothing beside it."""
    program = MEMORY.replace("TAKEN", taken)
    for verb, status in {"convert": 1, "serve": 0}.items():  # a server runs for weeks
        words = [sys.executable, "-c", program.replace("VERB", repr(verb))]
        done = subprocess.run(words, capture_output=True, text=True)
        assert done.returncode == status
        assert ("memory ran out" in done.stderr) == (status == 1)
        assert "Traceback" not in done.stderr


def test_processes_that_are_started_import_nothing_from_the_current_folder(monkeypatch, capsys):
    monkeypatch.setenv("PYTHONSAFEPATH", "")
    monkeypatch.delenv("PYTHONSAFEPATH")
    monkeypatch.setattr(sys, "argv", ["ico3d", "--version"])
    assert cli.main() == 0 and capsys.readouterr().out.startswith("ico3d ")
    assert os.environ["PYTHONSAFEPATH"] == "1"
