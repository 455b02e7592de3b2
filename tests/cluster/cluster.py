#!/usr/bin/env python3
"""Runs a small suite on two Slurm nodes with faults, and compares its rows with those of one process.

`./run cluster-torture` tries every fault, `--short` three of them in under three minutes.
"""

import argparse
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time

import faults
import slurm

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(os.path.dirname(HERE), "torture"))
from common import Counted, exit_with, litter_of, rows_of


class Trials(Counted):
    """Of many processes, and two nodes where Slurm is."""

    def __init__(self, program, folder, short, seed, nodes):
        super().__init__(program, folder, short)
        self.chance = random.Random(seed)
        self.nodes = nodes
        self.suite = HERE + "/cluster.yaml"
        self.rows = None
        self.planned = None

    def duet(self, *arguments, program=None, **options):
        environment = dict(self.nodes.environment if self.nodes else os.environ, **options.pop("variables", {}))
        return subprocess.run([program or self.program, *arguments], capture_output=True, text=True, check=False,
                              env=environment, timeout=600, **options)

    def start(self, run, shard, **variables):
        return subprocess.Popen([self.program, "work", run, "--shard", str(shard), "-j", "1", "-q"],
                                stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
                                env=dict(os.environ, **variables))

    def reference(self):
        """Rows by key of one process that nobody disturbed; made once."""
        if self.rows is None:
            out = self.folder + "/reference"
            ended = self.duet("run", self.suite, "-q", "-j", "1", "-o", out)
            self.check("a run of one process ends well", ended.returncode == 0, ended.stderr)
            self.rows = rows_of(out)
        return self.rows

    def plan(self, name, folder=None, shards=4):
        """A planned run of that name without any rows; planned once and copied."""
        if self.planned is None:
            self.planned = {}
        if shards not in self.planned:
            base = f"{self.folder}/planned-{shards}"
            costs = ["--cost", "playback/vmc=0.001", "--cost", "mujoco/vmc=0.02"]
            ended = self.duet("plan", self.suite, "-q", *costs, "--shards", str(shards), "-o", base)
            self.check("a plan is made", ended.returncode == 0, ended.stderr)
            self.planned[shards] = base
        run = f"{folder or self.folder}/{name}"
        shutil.copytree(self.planned[shards], run)
        return run

    def work(self, run, shards=4, program=None, **options):
        """All shards, one after the other; their exit codes."""
        return [self.duet("work", run, "--shard", str(shard), "-j", "1", "-q", program=program, **options).returncode
                for shard in range(shards)]

    def submit(self, run, *more):
        ended = self.duet("submit", run, "--slurm", "--time", "00:05:00", "--json", *more)
        self.check("the run is submitted", ended.returncode == 0, ended.stderr)
        return json.loads(ended.stdout)

    def status(self, run):
        return json.loads(self.duet("status", run, "--json").stdout)

    def wait_for_rows(self, run, count=1, seconds=60):
        until = time.monotonic() + seconds
        while self.status(run)["done"] < count and time.monotonic() < until:
            time.sleep(0.05)

    def check_run(self, what, run, merge=True):
        """The merged rows are those of one process: the same episodes, each once, each bit the same."""
        if merge:
            ended = self.duet("merge", run, "-q")
            self.check(f"{what}: merges", ended.returncode == 0, ended.stderr + ended.stdout)
        self.check_same_rows(what, self.reference(), run)
        litter = litter_of(run)
        self.check(f"{what}: nothing half-written is left", not litter, litter)


def run_trials(trials, only):
    def skip(trial):
        return "Slurm does not start here" if trials.nodes is None and trial in faults.NEED_SLURM else None
    trials.try_each(faults.SHORT if trials.short else faults.ALL, only, skip=skip)


def start_nodes(folder):
    """None, with the reason said, where Slurm cannot start."""
    lacks = slurm.missing()
    if lacks:
        print(f"cluster: SKIPPED the trials of Slurm: {', '.join(lacks)} not installed (Debian: slurm-wlm munge)")
        return None
    nodes = slurm.Nodes(folder + "/slurm")
    try:
        nodes.start()
        return nodes
    except (RuntimeError, OSError, subprocess.TimeoutExpired) as error:
        nodes.stop()
        print(f"cluster: SKIPPED the trials of Slurm: it does not start here: {error}")
        return None


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--program", default="build/release/duet")
    parser.add_argument("--short", action="store_true", help="three faults")
    parser.add_argument("--seed", type=int, default=random.SystemRandom().randrange(10**6), help="of the moments")
    parser.add_argument("--only", help="trials whose name contains this")
    parser.add_argument("--folder", help="where (default: a temporary folder)")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="duet-cluster-", dir=arguments.folder) as folder:
        print(f"cluster: {os.path.abspath(arguments.program)}, --seed {arguments.seed}", flush=True)
        nodes = start_nodes(folder)
        trials = Trials(arguments.program, folder, arguments.short, arguments.seed, nodes)
        try:
            run_trials(trials, arguments.only)
        finally:
            if nodes:
                nodes.stop()
    exit_with(trials)


if __name__ == "__main__":
    main()
