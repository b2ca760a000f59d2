"""The command of the training."""

from __future__ import annotations

import argparse
import dataclasses

from skyarm.control.laws.learned.network import write_network
from skyarm.files import write_atomically
from skyarm.learn.training import Budget
from skyarm.learn.training_rounds import learn, training_record


def main() -> None:
    """Train and write the file."""
    parser = argparse.ArgumentParser(description="Train the network of the learned compensator.")
    parser.add_argument("file", help="JSON file that is written")
    budget = Budget()
    for name in ("flights", "rounds", "epochs", "seed"):
        parser.add_argument(f"--{name}", type=int, default=getattr(budget, name))
    given = vars(parser.parse_args())
    path = given.pop("file")
    budget = dataclasses.replace(budget, **given)
    learned = learn(budget, print)
    write_atomically(path, write_network(learned.network, training_record(budget, learned)).encode())


if __name__ == "__main__":
    main()
