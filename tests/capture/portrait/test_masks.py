import numpy as np
import pytest

from ico3d.capture.face.landmarks import (
    CHIN,
    FACE_OVAL,
    FOREHEAD,
    INNER_LIPS,
    JAW,
    MULTI_PIE,
    OUTER_LIPS,
    SIDES,
)
from ico3d.capture.portrait.plate import clean_plate, filled, mismatch

cv2 = pytest.importorskip("cv2")


def test_multi_pie_indices_are_68_of_478_in_mirrored_order():
    assert MULTI_PIE.shape == (68,) and MULTI_PIE.max() < 478
    assert len(set(MULTI_PIE.tolist())) == 68
    assert MULTI_PIE[[36, 45, 48, 54]].tolist() == [33, 263, 61, 291]


def test_what_was_seen_stays_and_the_rest_is_filled_from_around():
    ramp = np.repeat(np.linspace(0, 200, 64, dtype=np.float32)[None, :, None], 48, 0).repeat(3, 2)
    seen = np.ones((48, 64), bool)
    seen[10:40, 20:44] = False
    result = filled(np.where(seen[..., None], ramp, 0), seen)
    np.testing.assert_array_equal(result[seen], ramp[seen])
    assert np.abs(result - ramp)[~seen].max() < 40
    assert result.min() >= 0 and result.max() <= 200


def test_clean_plate_is_the_background_wherever_it_was_seen():
    random = np.random.default_rng(0)
    background = random.integers(0, 255, (60, 80, 3), np.uint8)
    images, alphas = [], []
    for step in range(6):
        alpha = np.zeros((60, 80), np.float32)
        alpha[20:60, 10 + 8 * step : 34 + 8 * step] = 1
        images.append(np.where(alpha[..., None] > 0, np.uint8(77), background))
        alphas.append(alpha)
    plate, seen = clean_plate(images, alphas)
    assert seen == 1.0
    np.testing.assert_array_equal(plate, background)
    assert mismatch(plate, images, alphas) == 0.0
    shifted = [np.roll(image, 3, axis=0) for image in images]
    assert mismatch(plate, shifted, alphas) > 0.2


def _scene():
    """A painted person: skin oval, dark hair, red chest, before a green and grey wall."""
    random = np.random.default_rng(1)
    image = np.zeros((240, 240, 3), np.uint8)
    image[:] = (60, 140, 80)
    image[:, 120:] = (110, 120, 115)
    truth = np.zeros((240, 240), np.uint8)
    for target, hair, skin, cloth in (
        (image, (50, 30, 25), (224, 172, 150), (190, 20, 40)),
        (truth, 1, 1, 1),
    ):
        cv2.ellipse(target, (120, 95), (56, 72), 0, 0, 360, hair, -1)
        cv2.ellipse(target, (120, 240), (110, 70), 0, 0, 360, cloth, -1)
        cv2.rectangle(target, (102, 140), (138, 185), skin, -1)
        cv2.ellipse(target, (120, 110), (40, 52), 0, 0, 360, skin, -1)
    noisy = np.clip(image + random.normal(0, 5, image.shape), 0, 255).astype(np.uint8)
    return noisy, truth.astype(bool)


def _face():
    """Landmarks of that face; those that matting and parsing look at are where they belong."""
    face = np.full((478, 2), [120.0, 110.0])
    turn = np.linspace(0, 2 * np.pi, len(FACE_OVAL), endpoint=False)
    face[FACE_OVAL] = np.stack([120 + 40 * np.sin(turn), 110 - 52 * np.cos(turn)], 1)
    face[INNER_LIPS] = [120, 135] + 6 * np.stack(
        [np.cos(turn[:20] * 1.8), np.sin(turn[:20] * 1.8)], 1
    )
    face[OUTER_LIPS] = 1.4 * (face[INNER_LIPS] - [120, 135]) + [120, 135]
    low = np.linspace(0.6, 2 * np.pi - 0.6, 2 * len(JAW))[len(JAW) // 2 :][: len(JAW)]
    face[JAW] = np.stack([120 + 40 * np.sin(low), 110 - 52 * np.cos(low)], 1)
    face[CHIN], face[FOREHEAD] = (120, 162), (120, 58)
    face[SIDES[0]], face[SIDES[1]] = (80, 110), (160, 110)
    return face


def test_person_is_cut_out_and_parsed():
    from ico3d.capture.portrait import cutout, parsing

    image, truth = _scene()
    images, faces = [image] * 4, np.stack([_face()] * 4)
    models = cutout.learn([cutout.working(i) for i in images], faces)
    alpha = cutout.cut(image, faces[0], models)
    both = ((alpha > 0.5) & truth).sum() / ((alpha > 0.5) | truth).sum()
    assert both > 0.95
    colours = parsing.learn_colours(images, [alpha] * 4, faces)
    parts = parsing.parse(image, alpha, faces[0], colours)
    at = {"face": (110, 95), "mouth": (135, 120), "hair": (40, 120), "neck": (170, 120)}
    colours = {name: tuple(parts[place].tolist()) for name, place in at.items()}
    assert colours == {
        "face": parsing.FACE,
        "mouth": parsing.MOUTH,
        "hair": parsing.HAIR,
        "neck": parsing.NECK,
    }
    assert tuple(parts[225, 60].tolist()) == parsing.CLOTH
    assert tuple(parts[10, 10].tolist()) == parsing.BACKGROUND


def test_silhouette_points_project_into_the_silhouette():
    from ico3d.capture.surface.first_points import silhouette_points
    from ico3d.common.camera import Camera

    lens = np.array([[300.0, 0, 40], [0, 300.0, 30], [0, 0, 1]])
    camera = Camera(80, 60, lens, np.diag([1.0, -1, -1, 1]))
    head = np.eye(4)
    head[:3, :3] = [[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]]
    head[:3, 3] = [0.01, -0.02, -0.7]
    mask = np.zeros((60, 80), bool)
    mask[10:40, 20:50] = True
    points = silhouette_points(mask, camera, head, (-0.03, 0.04), 500)
    pixels, depths = camera.moved(head).project(points)
    columns, rows = np.floor(pixels + 1e-4).astype(int).T
    assert mask[rows, columns].mean() > 0.99
    assert 0.62 < depths.min() < depths.max() < 0.77
    assert not len(silhouette_points(mask & False, camera, head, (0.0, 0.0), 10))
