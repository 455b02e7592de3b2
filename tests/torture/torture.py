#!/usr/bin/env python3
"""Kills, starves and shares runs of the built program, and counts what holds: `./run torture [--short]`."""

import argparse
import random
import tempfile

import disks
import kills
import links
import processes
import sharing
from common import Trials, exit_with


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--program", default="build/release/duet")
    parser.add_argument("--short", action="store_true", help="one or two minutes instead of ten")
    parser.add_argument("--seed", type=int, default=random.SystemRandom().randrange(10**6), help="of the moments of kills")
    parser.add_argument("--only", help="trials whose name contains this")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="duet-torture-") as folder:
        trials = Trials(arguments.program, folder, arguments.short, arguments.seed)
        print(f"torture: {trials.program}, engines {trials.engines}, --seed {arguments.seed}", flush=True)
        for room in (kills, sharing, disks, processes, links):
            trials.try_each(room.TRIALS, arguments.only, lambda trial: f"{trial.__module__}.{trial.__name__}")
        exit_with(trials)


if __name__ == "__main__":
    main()
