"""The queue of a full server, without a server: who is next, and how long that takes."""

import asyncio
import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ico3d.chat.serving.waiting import FullError, Stays, WaitingLine


class House:
    """A server with places and nothing else."""

    def __init__(self, places, most=50, kept=30.0):
        self.free = places
        self.line = WaitingLine(lambda: self.free, most, kept)

    def come(self, id=None):
        """Somebody comes, and begins at once if admitted."""
        ticket = self.line.join(id)
        if ticket.admitted:
            self.begin(ticket)
        return ticket

    def begin(self, ticket):
        self.free -= 1
        self.line.leave(ticket)

    def give_back(self):
        self.free += 1
        self.line.move_up()


async def test_places_are_given_in_the_order_of_arrival():
    house = House(2)
    assert [house.come().admitted for _ in range(2)] == [True, True]
    waiting = [house.come() for _ in range(3)]
    assert [house.line.position(ticket) for ticket in waiting] == [1, 2, 3]
    house.give_back()
    assert [ticket.admitted for ticket in waiting] == [True, False, False]
    late = house.come()  # before the first one has begun: no place is free for anybody else
    assert not late.admitted and house.line.position(late) == 3
    house.begin(waiting[0])
    assert [ticket.admitted for ticket in waiting] == [True, False, False]
    assert waiting[1].changed.is_set() and house.line.position(waiting[1]) == 1


async def test_a_visitor_who_was_admitted_and_did_not_begin_makes_room():
    house = House(0)
    first, second = house.come(), house.come()
    house.give_back()
    house.line.leave(first)
    assert second.admitted


async def test_a_dropped_page_keeps_its_position_for_a_while():
    house = House(0, kept=30.0)
    first, second, third = (house.come() for _ in range(3))
    house.line.leave(first, for_good=False)
    await asyncio.sleep(29.0)
    assert house.line.position(second) == 2
    again = house.come(first.id)
    assert again.id == first.id and house.line.position(again) == 1 and first.replaced
    house.line.leave(first)  # its old connection is noticed only now
    await asyncio.sleep(60.0)
    assert house.line.position(again) == 1
    house.line.leave(again, for_good=False)
    await asyncio.sleep(30.1)
    assert house.line.position(second) == 1 and house.line.position(third) == 2
    stranger = house.come(first.id)  # too late: behind all others, under another name
    assert stranger.id != first.id and house.line.position(stranger) == 3


async def test_nobody_waits_for_a_page_that_is_away():
    house = House(0)
    first, second = house.come(), house.come()
    house.line.leave(first, for_good=False)
    house.give_back()
    assert second.admitted and not first.admitted
    house.begin(second)
    house.give_back()
    again = house.come(first.id)
    assert again.admitted and len(house.line) == 0


async def test_the_queue_is_bounded():
    house = House(0, most=2)
    house.come()
    second = house.come()
    with pytest.raises(FullError):
        house.come()
    house.line.leave(second, for_good=False)
    with pytest.raises(FullError):
        house.come()
    assert not house.come(second.id).admitted  # who waits already may come back
    house.line.leave(second)  # a ticket that was replaced leaves nothing
    assert len(house.line) == 2


@given(st.lists(st.tuples(st.sampled_from("jldba"), st.integers(0, 9)), max_size=60))
def test_no_place_is_given_twice_and_none_stays_empty(steps):
    async def play():
        house = House(2, most=5)
        tickets, inside = [], 0
        for step, index in steps:
            ticket = tickets[index % len(tickets)] if tickets else None
            if step == "j":
                with contextlib.suppress(FullError):
                    tickets.append(house.line.join(None))
            elif step in "ld" and ticket and not ticket.admitted:
                house.line.leave(ticket, for_good=step == "l")
            elif step == "b" and ticket and ticket.admitted:
                tickets.remove(ticket)
                house.begin(ticket)
                inside += 1
            elif step == "a" and inside:
                inside -= 1
                house.give_back()
            admitted = [t for t in tickets if t.admitted]
            assert len(admitted) + inside <= 2
            present = [t for t in house.line._waiting.values() if t.expiry is None]
            assert not present or len(admitted) + inside == 2
            for ticket in house.line._waiting.values():
                assert 1 <= house.line.position(ticket) <= len(house.line) <= 5

    asyncio.run(play())


def test_waits_are_estimated_from_how_long_visitors_stay():
    stays = Stays()
    assert stays.until_free(1, [10.0]) is None  # nobody has left yet
    stays.end(60.0)
    stays.end(180.0)
    assert stays.until_free(1, []) is None
    # two have left within 60 + 180 + 30 + 30 s of visits: one of two leaves every 75 s
    assert stays.until_free(1, [30.0, 30.0]) == pytest.approx(75.0)
    assert stays.until_free(3, [30.0, 30.0]) == pytest.approx(225.0)
    for _ in range(16):
        stays.end(40.0)  # older stays are forgotten
    assert stays.until_free(1, [0.0]) == pytest.approx(40.0)
