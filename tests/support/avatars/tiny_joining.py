"""Joining a head to a body in seconds, all of it or its colours alone."""

from dataclasses import replace
from pathlib import Path

from ico3d.avatar.avatar import Placement
from ico3d.avatar.joining.assemble import Assembly
from ico3d.avatar.joining.driving import head_poses, recorded_expressions
from ico3d.avatar.joining.face_views import face_views
from ico3d.avatar.joining.settings import JoiningSettings
from ico3d.body.settings import settings_for
from ico3d.capture.face.region import HeadRegion
from support.avatars.planted_person import face
from support.settings import changed

STEPS_PER_FRAME = 22
TINY = {
    "initial.gaussians": 400,
    "density.max_gaussians": 600,
    "steps_per_frame": STEPS_PER_FRAME,
    "warmup_steps": 20,
    "density.begin": 30,
    "encoder.space": 8,
    "mlp.width": 16,
    "finetune.steps": 0,
    "checkpoint_every": 60,
}
JOINING = JoiningSettings(border_points=60)


def assembly_of(head: Path, **joining) -> Assembly:
    """What to assemble in seconds."""
    body = changed(settings_for("cpu", "swings++"), TINY)
    return Assembly(head, replace(JOINING, **joining), body, 0)


def parts_of(capture, head):
    """Placement, expressions and views, for training and held out."""
    placement = Placement(capture.canonical_from_head, head_poses(capture))
    expressions = recorded_expressions(head, capture, head.neutral())
    region = HeadRegion.around(face())
    views = face_views(capture, placement, region, face())
    tested = face_views(capture, placement, region, face(), list(capture.split.test_cameras))
    return placement, expressions, views, tested
