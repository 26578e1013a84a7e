"""The order in which training takes up its pictures."""

from ico3d.training.epochs import Epochs


def test_each_once_per_epoch_in_an_order_of_its_own():
    epochs = [[Epochs([3], 7).at(7 * epoch + place) for place in range(7)] for epoch in range(3)]
    assert all(sorted(order) == list(range(7)) for order in epochs)
    assert epochs[0] != epochs[1] != epochs[2]


def test_steps_are_known_in_any_order():
    straight = [Epochs([3, 1], 5).at(step) for step in range(40)]
    asked = Epochs([3, 1], 5)
    assert [asked.at(step) for step in reversed(range(40))] == straight[::-1]
    assert [Epochs([4, 1], 5).at(step) for step in range(40)] != straight


def test_one_thing_is_always_the_one():
    assert [Epochs([0], 1).at(step) for step in range(3)] == [0, 0, 0]
