"""Groups that move alike, and their components."""

import numpy as np
import pytest

from ico3d.avatar.baking.motion_clusters import Channel, components, group

STEPS, EACH = 15, 40


def planted(groups: int, rank: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Courses (S, N, 3) along `rank` random curves of their group, and the groups (N,)."""
    rng = np.random.default_rng(seed)
    truth = rng.permutation(np.repeat(np.arange(groups), EACH))
    curves = rng.normal(size=(groups, STEPS, rank))
    shares = 1 + 0.2 * rng.normal(size=(len(truth), rank, 3))  # a limb's points move much alike
    mixed = np.einsum("nsk,nkd->snd", curves[truth], shares)
    return (mixed + rng.normal(size=(len(truth), 3))).astype(np.float32), truth


def test_planted_groups_are_found():
    values, truth = planted(4, 2)
    labels = group([Channel(values, np.ones(len(truth)), 2)], 4)
    assert labels.dtype == np.uint8
    for number in range(4):
        assert len(set(labels[truth == number])) == 1
    assert len(set(labels)) == 4


def test_components_span_the_courses_of_their_cluster():
    values, truth = planted(3, 2)
    channel = Channel(values, np.ones(len(truth)), 2)
    for cluster, span in enumerate(components(channel, truth, 3)):
        np.testing.assert_allclose(span.T @ span, np.eye(2), atol=1e-6)
        courses = channel.centred()[:, truth == cluster].reshape(STEPS, -1)
        np.testing.assert_allclose(span @ (span.T @ courses), courses, atol=1e-4)


def test_weights_decide_whose_course_is_kept():
    values, truth = planted(2, 1)
    for kept in (0, 1):
        channel = Channel(values, np.where(truth == kept, 1.0, 1e-3), 1)
        span = components(channel, np.zeros(len(truth), int), 1)[0]
        courses = channel.centred()[:, truth == kept].reshape(STEPS, -1)
        np.testing.assert_allclose(span @ (span.T @ courses), courses, atol=1e-2)


@pytest.mark.parametrize("rank", [1, 20])
def test_still_gaussians_and_few_moments_are_no_trouble(rank):
    still = np.ones((3, 5, 3), np.float32)
    channel = Channel(still, np.ones(5), rank)
    labels = group([channel], 4)
    spans = components(channel, labels, 4)
    assert spans.shape == (4, 3, rank) and np.isfinite(spans).all()


def test_one_seed_gives_one_grouping():
    values, truth = planted(5, 3)
    channel = Channel(values, np.ones(len(truth)), 2)
    assert (group([channel], 5) == group([channel], 5)).all()
