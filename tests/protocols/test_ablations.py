"""The protocol of ablations."""

from pathlib import Path

import pytest

from ico3d.body.settings import BodySettings
from ico3d.errors import SettingsError
from ico3d.head.settings import PRESETS
from ico3d.measure.methods.settings import preset
from ico3d.protocols import ablations
from ico3d.protocols.ablations import BODIES, HEADS, WHOLE, AblationTerms, measure_ablations
from ico3d.studio.layouts.portrait import write_portrait
from support.heads.tiny_talker import TinyTalker
from support.settings import changed

TINY = {
    "steps": 10,
    "network.features": 8,
    "network.hidden": 16,
    "initial.gaussians": 100,
    "density.max_gaussians": 120,
}


def test_each_ablation_changes_one_thing():
    settings = PRESETS["cpu"]
    for name, without in HEADS.items():
        same = without.change(settings) == settings and without.variant == "full"
        assert same == (name == WHOLE), name
    ours = preset("swings++")
    for name, without in BODIES.items():
        same = without.change(ours) == ours and without.method == "swings++"
        assert same == (name == WHOLE), name


def test_unknown_names_are_listed():
    terms = AblationTerms(Path("c"), Path("o"), "head", only=("no hair",))
    with pytest.raises(SettingsError, match="no ablation 'no hair': whole method, no MLP"):
        terms.chosen()
    body = AblationTerms(Path("c"), Path("o"), "body", only=("one window",))
    assert body.chosen() == [WHOLE, "one window"]


@pytest.mark.slow
def test_heads_without_a_part(tmp_path, monkeypatch):
    monkeypatch.setenv("ICO3D_MODELS", str(tmp_path))
    write_portrait(TinyTalker(tmp_path / "talker"), tmp_path / "portrait")
    terms = AblationTerms(
        tmp_path / "portrait",
        tmp_path / "out",
        "head",
        ("no expression", "no density control"),
        (0, 1),
        settings=changed(PRESETS["cpu"], TINY),
    )
    report = measure_ablations(terms)
    assert set(report.figures) == {WHOLE, "no expression", "no density control"}
    means = {row["name"]: row for row in report.sections[0].table.rows}
    seeds = [found["psnr_mask"] for found in report.figures[WHOLE]]
    assert means[WHOLE]["psnr_mask"] == pytest.approx(sum(seeds) / 2)
    assert means[WHOLE]["seeds_apart"] == pytest.approx(abs(seeds[0] - seeds[1]))
    assert means["no density control"]["num_gaussians"] == 120
    below = {row["name"]: row for row in report.sections[1].table.rows}
    lost = means[WHOLE]["psnr"] - means["no expression"]["psnr"]
    assert below["no expression"]["psnr"] == pytest.approx(lost)


def test_bodies_share_windows_and_flow(tmp_path, monkeypatch):
    """Every ablation is a trial of the comparison of methods, in a folder of its own."""
    (tmp_path / "flow").mkdir()
    measured = f"{7:024x}.npz"
    (tmp_path / "flow" / measured).touch()
    ran = []

    def terms_for(capture, frames, folder, settings, *rest, **named):
        return ablations_terms(folder, settings)

    class Ran:
        def __init__(self, method, seed, terms):
            ran.append((method, seed, terms.folder.name, terms.ours))

        def run(self):
            return {"psnr_mask": 20.0, "train_seconds": 1.0, "num_gaussians": 5}

    def ablations_terms(folder, settings):
        from ico3d.body.planning.windows import Window
        from ico3d.measure.methods.bench import Terms

        return Terms(Path("c"), None, folder, (Window(0, 3),), settings, False)

    monkeypatch.setattr(ablations, "terms_for", terms_for)
    monkeypatch.setattr(ablations, "Trial", Ran)
    terms = AblationTerms(Path("c"), tmp_path, "body", ("no encoder", "no warm-up"), (0,))
    measure_ablations(terms)
    assert [(method, folder) for method, _, folder, _ in ran] == [
        ("swings++", "whole-method"),
        ("swings", "no-encoder"),
        ("swings++", "no-warm-up"),
    ]
    settings = [ours for *_, ours in ran]
    assert all(isinstance(ours, BodySettings) for ours in settings)
    assert settings[2].warmup_steps == 0 and (tmp_path / "no-encoder/flow" / measured).is_file()
