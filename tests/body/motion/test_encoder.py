"""The space-time encoder: kernels and torch against one point and one plane at a time."""

import itertools

import numba
import pytest
import torch

from ico3d.body.motion.encoder import (
    EncoderShape,
    encode,
    initial_planes,
    space_smoothness,
    time_change,
    time_smoothness,
)
from ico3d.errors import SettingsError

pytestmark = pytest.mark.slow

SHAPE = EncoderShape(space=(6, 11), time=4, channels=16)
ODD = EncoderShape(space=(2, 3), time=3, channels=5)  # channels the kernels must pad
TIME = 0.4


def _case(shape: EncoderShape, count: int, dtype: torch.dtype = torch.float64):
    """Random planes and positions, some outside of the box, that ask for gradients."""
    generator = torch.Generator().manual_seed(1)
    planes = initial_planes(shape, generator)
    for name, plane in planes.items():
        noise = 0.3 * torch.randn(plane.shape, generator=generator)
        planes[name] = (plane + noise).to(dtype).requires_grad_()
    positions = 2.4 * torch.rand(count, 3, generator=generator) - 1.2
    return planes, positions.to(dtype).requires_grad_()


def _node(value, places: int):
    """The node before a value of −1 … 1, and how far it is to the next."""
    place = (value.clamp(-1, 1) + 1) / 2 * (places - 1)
    node = min(int(place), max(places - 2, 0))
    return node, place - node


def _reference(planes, shape, positions, time):
    """Bilinear by hand."""
    rows = []
    for position in positions:
        place = dict(zip("xyz", position, strict=True), t=position.new_tensor(2 * time - 1))
        features = []
        for scale in range(len(shape.space)):
            product = 1
            for name in ("xy", "xz", "yz", "xt", "yt", "zt"):
                plane = planes[f"{name}{scale}"]
                column, x = _node(place[name[0]], plane.shape[1])
                row, y = _node(place[name[1]], plane.shape[0])
                sample = 0
                for i, j in itertools.product((0, 1), (0, 1)):
                    node = plane[min(row + i, plane.shape[0] - 1), column + j]
                    sample = sample + (y if i else 1 - y) * (x if j else 1 - x) * node
                product = product * sample
            features.append(product)
        rows.append(torch.cat(features))
    return torch.stack(rows)


def _with_gradients(function, shape, count, dtype, time=TIME):
    """What a function gives and the gradients of all that it takes."""
    planes, positions = _case(shape, count, dtype)
    generator = torch.Generator().manual_seed(2)
    towards = torch.randn(count, shape.outputs, generator=generator).to(dtype)
    out = function(planes, shape, positions, time)
    out.backward(towards)
    gradients = {name: plane.grad for name, plane in planes.items()}
    return {"out": out.detach(), "positions": positions.grad, **gradients}


@pytest.mark.parametrize("shape", [SHAPE, ODD, EncoderShape((4,), time=1, channels=32)])
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_values_and_gradients_equal_the_reference(shape, dtype):
    found = _with_gradients(encode, shape, 40, dtype)
    expected = _with_gradients(_reference, shape, 40, torch.float64)
    tolerance = 1e-5 if dtype == torch.float32 else 1e-12
    for name, value in found.items():
        assert value.dtype == dtype
        close = tolerance * expected[name].abs().max().item()
        torch.testing.assert_close(value.double(), expected[name], rtol=0, atol=close, msg=name)


def test_gradients_of_the_reference_by_finite_differences():
    shape = EncoderShape(space=(3,), time=3, channels=2)
    planes, positions = _case(shape, 4)

    def function(positions, *values):
        return _reference(dict(zip(planes, values, strict=True)), shape, positions, TIME)

    assert torch.autograd.gradcheck(function, (positions, *planes.values()))


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_outside_are_the_features_of_the_border(dtype):
    planes, _ = _case(SHAPE, 1, dtype)
    inside = torch.tensor([[-1, 0.3, 1], [1, 1, 1], [0.5, -1, -0.2]], dtype=dtype)
    outside = torch.tensor([[-7, 0.3, 1.5], [1e30, 1.0001, 2], [0.5, -1.01, -0.2]], dtype=dtype)
    outside.requires_grad_()
    found = encode(planes, SHAPE, outside, TIME)
    assert torch.equal(found, encode(planes, SHAPE, inside, TIME))
    found.sum().backward()
    assert outside.grad is not None
    assert ((outside.grad != 0) == (inside.abs() < 1)).all()


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("node", range(SHAPE.time))
def test_the_whole_grid_of_time_is_used(dtype, node):
    """At the nodes, 0 and 1 among them, one row of each plane of time counts and no other."""
    found = _with_gradients(encode, SHAPE, 50, dtype, time=node / (SHAPE.time - 1))
    for name in ("xt0", "yt0", "zt0", "xt1", "yt1", "zt1"):
        by_row = found[name].abs().sum((1, 2))
        assert by_row[node] > 0
        assert (by_row > 1e-5 * by_row[node]).sum() == 1


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_times_outside_of_the_window_are_its_ends(dtype):
    planes, positions = _case(SHAPE, 20, dtype)
    for outside, end in ((-0.5, 0.0), (1.5, 1.0)):
        found = encode(planes, SHAPE, positions, outside)
        assert torch.equal(found, encode(planes, SHAPE, positions, end))


def test_at_first_time_changes_nothing():
    planes = initial_planes(SHAPE, torch.Generator().manual_seed(1))
    _, positions = _case(SHAPE, 20, torch.float32)
    first, second = (encode(planes, SHAPE, positions, time) for time in (0.0, 0.7))
    assert torch.equal(first, second)
    assert 0.1**3 <= first.min() <= first.max() <= 0.5**3
    again = initial_planes(SHAPE, torch.Generator().manual_seed(1))
    assert all(torch.equal(plane, again[name]) for name, plane in planes.items())


def test_points_do_not_see_one_another():
    planes, positions = _case(SHAPE, 300, torch.float32)
    order = torch.randperm(300, generator=torch.Generator().manual_seed(3))
    whole = encode(planes, SHAPE, positions, TIME)
    assert torch.equal(encode(planes, SHAPE, positions[order], TIME), whole[order])
    assert torch.equal(encode(planes, SHAPE, positions[:7], TIME), whole[:7])


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_no_points(dtype):
    found = _with_gradients(encode, SHAPE, 0, dtype)
    assert found["out"].shape == (0, SHAPE.outputs)
    assert found["positions"].shape == (0, 3)
    assert not found["xy0"].any()


def test_any_number_of_threads_gives_the_same():
    many = numba.get_num_threads()
    runs = []
    try:
        for threads in (many, 1):
            numba.set_num_threads(threads)
            runs.append(_with_gradients(encode, SHAPE, 3000, torch.float32))
    finally:
        numba.set_num_threads(many)
    for name, value in runs[0].items():
        assert torch.equal(value, runs[1][name]), name


def test_arguments_need_not_be_contiguous_nor_ask_for_gradients():
    planes, positions = _case(SHAPE, 30, torch.float32)
    expected = encode(planes, SHAPE, positions, TIME)
    turned = {name: plane.mT.contiguous().mT for name, plane in planes.items()}
    with torch.no_grad():
        found = encode(turned, SHAPE, positions.T.contiguous().T, TIME)
    assert torch.equal(found, expected)
    frozen = {name: plane.detach() for name, plane in planes.items()}
    encode(frozen, SHAPE, positions, TIME).sum().backward()
    assert positions.grad is not None


@pytest.mark.parametrize("wrong", [{"space": ()}, {"space": (1,)}, {"time": 0}, {"channels": 0}])
def test_planes_without_nodes_are_refused(wrong):
    with pytest.raises(SettingsError, match="does not exist"):
        EncoderShape(**wrong)


def test_other_sizes_are_refused():
    planes, positions = _case(SHAPE, 4, torch.float32)
    with pytest.raises(ValueError, match="scale 1"):
        encode({**planes, "zt1": planes["zt1"][:, :-1]}, SHAPE, positions, TIME)
    with pytest.raises(ValueError, match="positions"):
        encode(planes, SHAPE, positions[:, :2], TIME)


def test_regularisers():
    shape = EncoderShape(space=(3,), time=4, channels=1)
    planes = initial_planes(shape, torch.Generator().manual_seed(1))
    places = torch.arange(3.0)
    for name in ("xy0", "xz0", "yz0"):
        planes[name] = (places[:, None] + 2 * places)[..., None]
    assert space_smoothness(planes) == time_smoothness(planes) == time_change(planes) == 0
    planes["yz0"] = planes["yz0"] + places[:, None, None] ** 2  # bent along one axis by 2
    torch.testing.assert_close(space_smoothness(planes).item(), 2.0**2 / 6)
    planes["zt0"] = 1 - torch.arange(4.0)[:, None, None].expand(-1, 3, -1) ** 2
    torch.testing.assert_close(time_smoothness(planes).item(), 2.0**2 / 3)
    torch.testing.assert_close(time_change(planes).item(), (0 + 1 + 4 + 9) / 4 / 3)
    assert time_smoothness({"xt0": torch.rand(2, 3, 1)}) == 0
