"""MuJoCo's warnings while our plant uses it, and who gets them afterwards."""

from __future__ import annotations

import threading

import mujoco
import pytest

from skyarm.plant.mujoco import QUIET


@pytest.fixture
def told():
    """Warnings that a user's own handler got."""
    found: list[str] = []
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(found.append)
    yield found
    mujoco.set_mju_user_warning(before)


def test_a_users_own_handler_hears_nothing_of_ours_and_everything_before_and_after(
    told,
):
    mujoco.get_mju_user_warning()("before")
    for turn in ("first", "second"):
        with QUIET:
            mujoco.get_mju_user_warning()(f"within, the {turn} time")
            with QUIET:
                mujoco.get_mju_user_warning()("within, twice")
            mujoco.get_mju_user_warning()("still within")
        mujoco.get_mju_user_warning()(f"after the {turn} time")
    assert told == ["before", "after the first time", "after the second time"]


def test_it_is_quiet_until_the_last_thread_has_left(told):
    inside, leave = threading.Event(), threading.Event()

    def other():
        with QUIET:
            inside.set()
            leave.wait(60.0)

    thread = threading.Thread(target=other)
    thread.start()
    assert inside.wait(60.0)
    with QUIET:
        mujoco.get_mju_user_warning()("two inside")
    mujoco.get_mju_user_warning()("one inside")
    leave.set()
    thread.join(60.0)
    mujoco.get_mju_user_warning()("none inside")
    assert told == ["none inside"]
