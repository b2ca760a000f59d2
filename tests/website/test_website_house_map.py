"""The drawing and the table of the house that CONTRIBUTING.md shows are those of
today's rooms and imports.
"""

from __future__ import annotations

from itertools import pairwise

import house_map
import pytest


def test_the_drawing_is_that_of_the_imports() -> None:
    assert house_map.DRAWING.read_text() == house_map.drawing(), (
        "run python tests/website/house_map.py"
    )


def test_the_table_of_the_page_is_that_of_the_rooms() -> None:
    assert house_map.table() in house_map.PAGE.read_text(), (
        "run python tests/website/house_map.py"
    )
    assert (
        house_map.with_table(house_map.PAGE.read_text()) == house_map.PAGE.read_text()
    )
    assert max(map(len, house_map.table().splitlines())) <= 100


def test_every_room_has_a_sentence_and_a_file_of_its_own_to_begin_with() -> None:
    assert (
        sorted(house_map.SENTENCES)
        == sorted(house_map.FIRST)
        == sorted(house_map.rooms())
    )
    for room, file in house_map.FIRST.items():
        assert (house_map.SOURCE / "skyarm" / file).is_file(), file
        module = f"skyarm.{file.removesuffix('.py').replace('/', '.')}"
        assert house_map.room_of(module, house_map.rooms()) == room


def test_every_folder_of_the_package_is_a_room_or_holds_rooms() -> None:
    inside = {room.partition(".")[0] for room in house_map.rooms()} - {"__main__"}
    assert inside == {
        path.parent.name for path in (house_map.SOURCE / "skyarm").glob("*/__init__.py")
    }


@pytest.mark.parametrize("rooms", ["SENTENCES", "FIRST"])
def test_a_room_that_is_missing_is_found(
    rooms: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delitem(getattr(house_map, rooms), "simulate")
    with pytest.raises(KeyError, match="simulate"):
        house_map.table()


def test_a_room_imports_lower_floors_only() -> None:
    floor = {room: i for i, row in enumerate(house_map.floors()) for room in row}
    assert all(
        floor[room] < floor[other]
        for room, others in house_map.imports().items()
        for other in others
    )


def test_an_arrow_that_a_longer_way_implies_is_not_drawn() -> None:
    arrows = {"a": {"b", "c"}, "b": {"c"}, "c": set[str]()}
    assert house_map.essential(arrows) == {"a": {"b"}, "b": {"c"}, "c": set()}


def test_the_arrows_that_are_drawn_reach_what_all_arrows_reach() -> None:
    arrows = house_map.imports()
    drawn = house_map.essential(arrows)
    assert all(
        house_map.reachable(drawn, room) == house_map.reachable(arrows, room)
        for room in arrows
    )


def test_an_arrow_goes_from_row_to_row_down_to_its_room() -> None:
    arrows = house_map.essential(house_map.imports())
    rows = house_map.in_rows(arrows)
    ends: dict[str, set[str]] = {room: set() for room in arrows}
    for i, row in enumerate(rows):
        for place in row:
            assert all(below in rows[i + 1] for below in place.below)
            ends.setdefault(place.name, set()).update(
                room_at_the_end(below) for below in place.below
            )
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
