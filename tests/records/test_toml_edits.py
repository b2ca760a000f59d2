"""Edits of TOML text by path: what is asked for changes, and every comment, order and blank line stays."""

from __future__ import annotations

import tomllib

import pytest

from skyarm.records.files.toml_edits import add_key, leave_out, path_of, rename_key, set_value

TEXT = """\
# the head
name = "x"      # a name

[a.old]         # a table
k = 1           # one # two
"q.r" = [
    1,          # first
    2,
]
d.e.f = "#no comment"   # a comment

[a.old.deep]
s = '''
[a.old]
k = 5
'''

[[list]]        # first
name = "p"
table = { x = 1, y = { z = 2 } }   # inline

[[list]]
name = "r"
[[list.inner]]
v = true
"""


def the_change(before, after):
    """Lines that went and lines that came."""
    old, new = before.splitlines(), after.splitlines()
    return [x for x in old if x not in new], [x for x in new if x not in old]


@pytest.mark.parametrize(
    ("path", "new", "gone", "came"),
    [
        (("name",), "title", ['name = "x"      # a name'], ['title = "x"      # a name']),
        (
            ("a", "old"),
            "now",
            ["[a.old]         # a table", "[a.old.deep]"],
            ["[a.now]         # a table", "[a.now.deep]"],
        ),
        (("a", "old", "d"), "g", ['d.e.f = "#no comment"   # a comment'], ['g.e.f = "#no comment"   # a comment']),
        (
            ("a", "old", "d", "e"),
            "g h",
            ['d.e.f = "#no comment"   # a comment'],
            ['d."g h".f = "#no comment"   # a comment'],
        ),
        (("a", "old", "q.r"), "qr", ['"q.r" = ['], ["qr = ["]),
        (
            ("list", 0, "table", "y", "z"),
            "w",
            ["table = { x = 1, y = { z = 2 } }   # inline"],
            ["table = { x = 1, y = { w = 2 } }   # inline"],
        ),
        (("list", 1, "inner"), "outer", ["[[list.inner]]"], ["[[list.outer]]"]),
        (("list", 1, "inner", 0, "v"), "w", ["v = true"], ["w = true"]),
    ],
)
def test_a_renamed_key_changes_its_own_letters_alone(path, new, gone, came):
    assert the_change(TEXT, rename_key(TEXT, path, new)) == (gone, came)


def test_a_renamed_list_of_tables_is_renamed_at_each_of_its_headers():
    document = tomllib.loads(rename_key(TEXT, ("list",), "rows"))
    assert document["rows"] == tomllib.loads(TEXT)["list"]


@pytest.mark.parametrize(
    ("path", "value", "came"),
    [
        (("a", "old", "k"), 2.5, "k = 2.5           # one # two"),
        (("a", "old", "d", "e", "f"), "y", 'd.e.f = "y"   # a comment'),
        (("list", 0, "table", "y", "z"), [1, 2], "table = { x = 1, y = { z = [1, 2] } }   # inline"),
        (("list", 0, "name"), 'a "quoted" #', 'name = "a \\"quoted\\" #"'),
    ],
)
def test_a_value_is_set_and_the_comment_behind_it_stays(path, value, came):
    assert the_change(TEXT, set_value(TEXT, path, value))[1] == [came]


def test_a_value_of_several_lines_is_set():
    after = set_value(TEXT, ("a", "old", "deep", "s"), "short")
    assert tomllib.loads(after)["a"]["old"]["deep"] == {"s": "short"}
    assert "# the head" in after
    assert "# inline" in after


def test_a_key_is_left_out_with_its_lines():
    gone, came = the_change(TEXT, leave_out(TEXT, ("a", "old", "q.r")))
    assert came == []
    assert gone == ['"q.r" = [', "    1,          # first", "    2,", "]"]


def test_a_key_is_added_below_another_one():
    after = add_key(TEXT, ("list", 1, "name"), "mass", 0.5)
    assert after.splitlines()[after.splitlines().index('name = "r"') + 1] == "mass = 0.5"


def test_a_text_without_a_last_line_end_is_edited():
    assert add_key("[t]\n  a = 1", ("t", "a"), "b", True) == "[t]\n  a = 1\n  b = true\n"
    assert set_value("a = 1", ("a",), 2) == "a = 2"


def test_ends_of_lines_of_windows_stay():
    assert set_value("a = 1 # c\r\nb = 2\r\n", ("a",), 3) == "a = 3 # c\r\nb = 2\r\n"


@pytest.mark.parametrize(
    "edit", [lambda p: set_value(TEXT, p, 1), lambda p: leave_out(TEXT, p), lambda p: rename_key(TEXT, p, "z")]
)
def test_a_path_that_is_not_there_is_refused_by_its_name(edit):
    with pytest.raises(ValueError, match=r"a\.none.*not in the file"):
        edit(("a", "none", "k"))


def test_a_whole_table_is_not_left_out():
    with pytest.raises(ValueError, match="only a person can change"):
        leave_out(TEXT, ("a", "old"))


def test_a_key_of_a_message_is_found_by_name_and_by_place():
    document = tomllib.loads(TEXT)
    assert path_of("a.old.k", document) == ("a", "old", "k")
    assert path_of("list[1].inner[0].v", document) == ("list", 1, "inner", 0, "v")
    assert path_of("list[r].inner", document) == ("list", 1, "inner")
    assert path_of("list[2].name", document) is None
    assert path_of("list[none].name", document) is None
    assert path_of("a.other", document) is None
