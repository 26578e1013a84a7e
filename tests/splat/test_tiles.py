"""Which tiles a splat is listed in, whatever its numbers are."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from ico3d.splat.cpu import tiles
from ico3d.splat.cpu.projection import FARTHEST, project
from ico3d.splat.render import render
from support.splats import reference
from support.splats.reference import camera_at

pytestmark = pytest.mark.slow

WIDTH, HEIGHT = 200, 330
ACROSS, DOWN = tiles.tiles_across(WIDTH), -(-HEIGHT // tiles.TILE_HEIGHT)
BROKEN = st.sampled_from([np.nan, np.inf, -np.inf, 3e38, -3e38, 0.0, -1.0])


def powers(low: float, high: float) -> st.SearchStrategy[float]:
    """Positive numbers of all magnitudes between two."""
    return st.floats(np.log(low), np.log(high)).map(lambda power: float(np.exp(power)))


def signed(numbers: st.SearchStrategy[float]) -> st.SearchStrategy[float]:
    return st.builds(lambda number, sign: sign * number, numbers, st.sampled_from([-1, 1]))


NEAR = st.floats(-100, 500)
FAR = st.builds(lambda sign, rest: sign * FARTHEST + rest, st.sampled_from([-1, 1]), NEAR)
PLACES = NEAR | FAR | signed(powers(1, 1e38)) | BROKEN
POWERS = powers(1e-38, 1e6)
SPLATS = st.lists(
    st.tuples(
        st.tuples(PLACES, PLACES),
        st.tuples(POWERS | BROKEN, signed(POWERS) | BROKEN, POWERS | BROKEN),
        st.floats(0.01, 1) | BROKEN,
        st.tuples(*2 * [powers(0.1, 1e6) | st.just(FARTHEST) | BROKEN]),
    ),
    min_size=1,
    max_size=40,
)


def reserved_and_listed(
    means2d: np.ndarray, conics: np.ndarray, alphas: np.ndarray, extents: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Pairs for which there is room, and pairs that are listed, of each splat."""
    count = len(means2d)
    packed, ordered = np.empty((count, 8), np.float32), np.empty((count, 8), np.float32)
    tiles._pack(means2d, conics, alphas, extents, packed)
    order = np.arange(count, dtype=np.uint32)
    tiles._sort(order, packed, ordered)
    rooms = tiles._rooms(count, ordered, 0, ACROSS, DOWN)  # a part for each splat
    spare = count * ACROSS * DOWN  # what is too much shall be counted, not written beyond the end
    pairs = np.empty((rooms[-1] + spare, 3), np.int32)
    starts, ends = np.empty(count, np.int32), np.empty(count, np.int32)
    counts = np.zeros((count, ACROSS * DOWN), np.int32)
    tiles._list_all(rooms, order, ordered, 0, ACROSS, DOWN, starts, ends, counts, pairs)
    for start, end in zip(starts, ends, strict=True):
        first, behind = np.divmod(pairs[start:end, 2], tiles.ROWS)
        assert ((first >= 0) & (first < behind) & (behind <= tiles.TILE_HEIGHT)).all()
    return np.diff(rooms), ends - starts


@given(SPLATS)
def test_no_splat_is_listed_in_more_tiles_than_have_room(splats):
    arrays = [np.array(part, np.float32) for part in zip(*splats, strict=True)]
    reserved, listed = reserved_and_listed(*arrays)
    assert (reserved >= 0).all()
    assert (listed <= reserved).all()


@given(
    st.lists(
        st.tuples(
            st.tuples(NEAR | FAR, NEAR | FAR),
            powers(0.01, 1e3),
            st.tuples(*3 * [powers(1e-5, 1e8)]),
            st.tuples(*4 * [st.floats(-1, 1)]),
        ),
        min_size=1,
        max_size=40,
    )
)
def test_what_is_projected_fits_into_the_room_for_it(gaussians):
    """Also at a million pixels beside the picture, where the projection limits a splat's box."""
    focal = 500.0
    camera = np.array([[focal, focal, WIDTH / 2, HEIGHT / 2, *np.eye(3).ravel(), 0, 0, 0]])
    places, depths, scales, quats = (np.array(part) for part in zip(*gaussians, strict=True))
    slopes = (places - [WIDTH / 2, HEIGHT / 2]) / focal
    means = np.concatenate([slopes * depths[:, None], depths[:, None]], 1).astype(np.float32)
    found = project(
        camera,
        means,
        quats.astype(np.float32),
        scales.astype(np.float32),
        np.ones(len(means), np.float32),
        WIDTH,
        HEIGHT,
        antialiased=False,
    )
    means2d, conics, alphas, _, extents = (part[0] for part in found)
    reserved, listed = reserved_and_listed(means2d, conics, alphas, extents)
    assert (listed <= reserved).all()


def test_a_picture_in_bands_is_the_same(monkeypatch):
    """Where pairs would fill the memory, a picture is drawn in several bands."""
    camera = camera_at((0, 0, 1.0), width=WIDTH, height=HEIGHT, focal=300.0)

    def run():
        ours = reference.scene(400, 5, dtype=torch.float32).map(lambda t: t.requires_grad_())
        drawn = render(ours, [camera], absgrad=True)
        (drawn.rgb.square().sum() + drawn.depth.sum() + drawn.alpha.sum()).backward()
        pictures = drawn.rgb, drawn.alpha, drawn.depth
        leaves = (ours.means, ours.quats, ours.scales, ours.opacities, ours.colors)
        return pictures, [*(leaf.grad for leaf in leaves), drawn.info.screen_gradients()]

    rooms: list[int] = []
    band = tiles._band

    def noted(*arguments):
        made = band(*arguments)
        rooms.append(made.room)
        return made

    monkeypatch.setattr(tiles, "_band", noted)
    whole, gradients = run()
    (at_once,) = set(rooms)
    rooms.clear()
    monkeypatch.setattr(tiles, "MOST_PAIRS", at_once // 5)
    parts, others = run()
    assert max(rooms) <= at_once // 5
    assert len(rooms) > 3 * 5  # for the colours, for the depth, and for the gradients of either
    assert all(torch.equal(a, b) for a, b in zip(parts, whole, strict=True))
    for a, b in zip(others, gradients, strict=True):
        assert (a - b).abs().max() <= 1e-5 * b.abs().max()


def test_memory_does_not_grow_with_splats_that_cover_the_picture(monkeypatch):
    """Of however many of them: no band has more pairs than what one block needs, or the bound."""
    monkeypatch.setattr(tiles, "MOST_PAIRS", 5000)
    count = 1000
    made = tiles.bin_splats(
        np.full((count, 2), 100, np.float32),
        np.tile(np.float32([1e-6, 0, 1e-6]), (count, 1)),
        np.full(count, 0.5, np.float32),
        np.ones(count, np.float32),
        np.full((count, 2), 1e4, np.float32),
        WIDTH,
        HEIGHT,
    )
    bands = list(made.bands())
    assert [band.across for band in bands] == [tiles.BLOCK] * (ACROSS // tiles.BLOCK)
    assert sum(len(band.entries) for band in bands) == count * ACROSS * DOWN
    assert all(band.room == count * tiles.BLOCK * DOWN for band in bands)
