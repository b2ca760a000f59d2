"""The drawing of the house that CONTRIBUTING.md shows is that of today's imports."""

from __future__ import annotations

from itertools import pairwise

import house_map


def test_the_drawing_is_that_of_the_imports() -> None:
    assert house_map.DRAWING.read_text() == house_map.drawing(), "run python tests/website/house_map.py"


def test_every_room_has_a_sentence() -> None:
    assert sorted(house_map.SENTENCES) == sorted(house_map.rooms())


def test_an_arrow_that_a_longer_way_implies_is_not_drawn() -> None:
    arrows = {"a": {"b", "c"}, "b": {"c"}, "c": set[str]()}
    assert house_map.essential(arrows) == {"a": {"b"}, "b": {"c"}, "c": set()}


def test_the_arrows_that_are_drawn_reach_what_all_arrows_reach() -> None:
    arrows = house_map.imports()
    drawn = house_map.essential(arrows)
    assert all(house_map.reachable(drawn, room) == house_map.reachable(arrows, room) for room in arrows)


def test_an_arrow_goes_from_row_to_row_down_to_its_room() -> None:
    arrows = house_map.essential(house_map.imports())
    rows = house_map.in_rows(arrows)
    ends: dict[str, set[str]] = {room: set() for room in arrows}
    for i, row in enumerate(rows):
        for place in row:
            assert all(below in rows[i + 1] for below in place.below)
            ends.setdefault(place.name, set()).update(room_at_the_end(below) for below in place.below)
    del ends[""]  # of passages
    assert ends == arrows


def room_at_the_end(place: house_map.Place) -> str:
    while not place.name:
        (place,) = place.below
    return place.name


def test_rooms_of_a_row_do_not_overlap() -> None:
    rows = house_map.in_rows(house_map.essential(house_map.imports()))
    house_map.spread(rows)
    for row in rows:
        ends = [(place.x - place.width / 2, place.x + place.width / 2) for place in row]
        assert all(right < left for (_, right), (left, _) in pairwise(ends))
