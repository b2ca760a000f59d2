"""Shares of the workers: no file is left out or collected by two, and every test is
handed out once, whatever dies.
"""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from support.shares import (
    EVERYONES,
    ROOT,
    ShareScheduling,
    others_of,
    seconds_of_files,
    shares_of,
)

FILES = {
    path.relative_to(ROOT).as_posix() for path in (ROOT / "tests").rglob("test_*.py")
}


@pytest.mark.parametrize("count", [2, 3, 8])
def test_every_file_is_of_one_share_and_each_worker_leaves_the_files_of_the_others(
    count,
):
    shares = shares_of(seconds_of_files(), count)
    assert sorted(file for share in shares for file in share) == sorted(FILES)
    assert len(shares) == count + 1
    for worker, own in enumerate(shares[:-1]):
        assert FILES - others_of(worker, count) == own | shares[-1]


@pytest.mark.parametrize("count", [2, 4])
def test_shares_take_as_long_as_each_other_and_everyones_as_stated(count):
    seconds = seconds_of_files()
    *own, everyones = (
        sum(seconds[file] + 0.05 for file in share)
        for share in shares_of(seconds, count)
    )
    longest = max(seconds.values())
    assert max(own) - min(own) < 2.0 * longest
    assert everyones == pytest.approx(
        EVERYONES * (sum(own) + everyones), abs=2.0 * longest
    )


class Node:
    """Worker that runs what it is given, in order, and holds its last test back until
    it is told to end.
    """

    def __init__(self, names):
        self.names, self.queue, self.shutting_down = names, [], False

    def send_runtest_some(self, indices):
        assert not self.shutting_down
        self.queue += indices

    def shutdown(self):
        self.shutting_down = True

    def run(self, scheduling):
        """Name of the next test, which ends; None while it waits."""
        if len(self.queue) < (1 if self.shutting_down else 2):
            return None
        index = self.queue.pop(0)
        scheduling.mark_test_complete(self, index)
        return self.names[index]


def collected(common, *owned):
    """Scheduling of workers that have collected tests of their own before those of
    everyone.
    """
    session = SimpleNamespace(testscollected=0)
    config = SimpleNamespace(
        option=SimpleNamespace(tx=owned),
        pluginmanager=SimpleNamespace(get_plugin={"session": session}.get),
    )
    scheduling = ShareScheduling(config)
    nodes = [
        Node([f"own {k}.{i}" for i in range(count)] + common)
        for k, count in enumerate(owned)
    ]
    for node in nodes:
        scheduling.add_node(node)
        assert not scheduling.collection_is_completed
        scheduling.add_node_collection(node, node.names)
    scheduling.schedule()
    return scheduling, nodes, session


@pytest.mark.parametrize(
    ("common", "owned"),
    [
        (30, (20, 20)),
        (30, (1, 50)),
        (0, (3, 0)),
        (1, (0, 0)),
        (5, (4,)),
        (2, (9, 1, 0)),
    ],
)
def test_every_test_is_run_once_and_all_workers_end(common, owned):
    everyones = [f"everyone's {i}" for i in range(common)]
    scheduling, nodes, session = collected(everyones if len(owned) > 1 else [], *owned)
    done = []
    while now := [name for node in nodes if (name := node.run(scheduling))]:
        done += now
    for node in nodes if scheduling.tests_finished else ():  # as pytest-xdist does then
        node.shutdown()
    while now := [name for node in nodes if (name := node.run(scheduling))]:
        done += now
    assert sorted(done) == sorted({name for node in nodes for name in node.names})
    assert session.testscollected == len(done)
    assert (scheduling.tests_finished, scheduling.has_pending) == (True, False)
    assert [scheduling.remove_node(node) for node in nodes] == [None] * len(owned)


def test_what_a_dead_worker_had_is_run_by_the_one_in_its_place():
    scheduling, (first, second), _ = collected(["any 0", "any 1"], 4, 3)
    done = [first.run(scheduling), second.run(scheduling)]
    assert scheduling.remove_node(first) == "own 0.1"
    assert not scheduling.tests_finished
    clone = Node(
        [
            "own 0.0",
            "own 0.1",
            "own 0.2",
            "own 0.3",
            "own 1.0",
            "own 1.1",
            "own 1.2",
            "any 0",
            "any 1",
        ]
    )
    scheduling.add_node(clone)
    scheduling.add_node_collection(clone, clone.names)
    scheduling.schedule()
    for _ in range(20):
        done += [name for node in (second, clone) if (name := node.run(scheduling))]
    assert scheduling.tests_finished
    assert sorted(done) == sorted({*clone.names} - {"own 0.1"})
