"""Each part of the pipeline against an independent implementation of the published program.

Expected numbers are those of the package syncnet-python 0.2.3 (calc_pdist, S3FD.detect_faces)
and of python_speech_features 0.6, on CPU, with the made-up weights, pictures and sounds of
`support.weights.sync`, which are the same on any machine.
"""

import numpy as np
import pytest
import torch

from ico3d.measure.sync.detectors import reduced
from ico3d.measure.sync.mfcc import mfcc
from ico3d.measure.sync.s3fd import S3fd, faces_of
from ico3d.measure.sync.score import mean_distances, scores_of
from support.weights.sync import made_up, made_up_faces, made_up_features, made_up_sound


def test_mfcc():
    rows = mfcc(made_up_sound(0.48))
    assert rows.shape == (47, 13)
    expected = [
        [20.41806, -34.177845, -3.98414, -1.362198],
        [18.264706, -35.809975, -8.149149, 9.807357],
        [21.029883, -35.376935, -8.751267, -7.709438],
    ]
    np.testing.assert_allclose(rows[[0, 20, -1]][:, [0, 1, 5, 12]], expected, atol=1e-5)
    assert mfcc(np.zeros(100, np.int16)).shape == (1, 13)


def test_scores():
    lips, sound = made_up_features()
    means = mean_distances(lips, sound)
    np.testing.assert_allclose(means[[0, 15, 30]], [4.3179626, 3.4743676, 4.2862501], atol=1e-5)
    found = scores_of(lips, sound, 44, "s3fd")
    assert (found.offset, found.frames, found.detector) == (-4, 44, "s3fd")
    assert found.distance == pytest.approx(1.8355440, abs=1e-5)
    assert found.confidence == pytest.approx(2.0614261, abs=1e-5)


def test_faces():
    network = S3fd()
    network.load_state_dict(made_up(network, 2))
    right = made_up_faces(1, 8)[0][:, ::-1]
    picture = np.concatenate([made_up_faces(1, 7)[0], right], 1)[:190, :406]
    small = reduced(picture)
    assert small.shape == (48, 102, 3)
    with torch.no_grad():
        found = faces_of(network(torch.from_numpy(small).float())).numpy()
    found[:, :4] *= (406 / 102, 190 / 48, 406 / 102, 190 / 48)
    expected = [
        [-324.679, -389.997, 625.874, 587.145, 1.0],
        [294.687, 109.235, 431.065, 243.122, 0.996],
        [103.731, -49.129, 239.768, 84.614, 0.986],
        [103.577, 109.037, 240.214, 243.23, 0.984],
        [-23.611, 108.955, 112.672, 243.536, 0.974],
        [294.755, -49.083, 430.801, 84.721, 0.966],
    ]
    assert len(found) == 7
    np.testing.assert_allclose(found[:6, :4], np.array(expected)[:, :4], atol=0.05)
    np.testing.assert_allclose(found[:6, 4], np.array(expected)[:, 4], atol=1e-3)
