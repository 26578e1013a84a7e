"""Planted heads of both kinds, and their bundles."""

from pathlib import Path

import pytest
import torch

from ico3d.avatar.baking import head_bundle, head_cost
from ico3d.avatar.baking.persona import load_persona
from ico3d.avatar.baking.samples import recorded_samples
from ico3d.avatar.baking.shader_head import BakeSettings
from ico3d.bundle.format import Bundle
from ico3d.head.model_folder import TrainedHead
from ico3d.speech.encoder import load_encoder
from ico3d.speech.network import SpeechAdaptor
from support.avatars.origins import about
from support.avatars.planted import (
    PlantedCapture,
    planted_blendshape_head,
    planted_eyes,
    planted_model,
)


@pytest.fixture
def blendshape_head(tmp_path) -> tuple[TrainedHead, PlantedCapture]:
    return planted_blendshape_head(tmp_path / "planted")


def _speech_head(folder: Path) -> tuple[TrainedHead, PlantedCapture]:
    capture = PlantedCapture(folder)
    encoder = load_encoder("builtin")
    torch.manual_seed(0)
    adaptor = SpeechAdaptor(encoder.size).requires_grad_(False)
    about = ("speech", (), "builtin", encoder.sha256, adaptor, {})
    capture.head = TrainedHead(planted_model(39), *about, eyes=planted_eyes(capture))
    return capture.head, capture


@pytest.fixture(scope="module", params=["speech", "blendshapes"])
def baked(request, tmp_path_factory):
    """Head, capture and the opened bundle of both kinds."""
    folder = tmp_path_factory.mktemp("planted")
    make = _speech_head if request.param == "speech" else planted_blendshape_head
    head, capture = make(folder)
    views = head_cost.references(head, capture, (0.5, 0.5, 0.5), 6)
    quick = BakeSettings(hidden=64, augmented=100, steps=300)
    samples = recorded_samples(head, capture)
    result = head_bundle.bake(head, views, samples, 8, [].append, quick)
    out = folder / "planted.ico3d"
    told = about(load_persona(None), capture.provenance, name="Planted", notices="A notice.")
    head_bundle.write(out, result, samples, head, capture, told)
    return head, capture, Bundle.open(out)
