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
TIMES = ("started_at", "wall_s", "policy_ms")  # all that may differ between two runs of one episode


def lasting(row):
    return {name: value for name, value in row.items() if name not in TIMES}


def rows_of(run):
    with open(run + "/episodes.jsonl", encoding="utf-8") as file:
        lines = file.read().split("\n")[:-1]
    return lines, {row["key"]: lasting(row) for row in map(json.loads, lines)}


class Trials:
    """The program, two nodes where Slurm is, and what was tried."""

    def __init__(self, program, folder, short, seed, nodes):
        self.program = os.path.abspath(program)
        self.folder = folder
        self.short = short
        self.chance = random.Random(seed)
        self.nodes = nodes
        self.passed = self.failed = 0
        self.suite = HERE + "/cluster.yaml"
        self.rows = None
        self.planned = None

    def check(self, what, holds, detail=""):
        self.passed += bool(holds)
        self.failed += not holds
        if not holds:
            print(f"  FAILED {what}: {detail}", flush=True)

    def say(self, text):
        print(f"  {text}", flush=True)

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
            self.rows = rows_of(out)[1]
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
        lines, rows = rows_of(run)
        wanted = self.reference()
        self.check(f"{what}: none lost", not wanted.keys() - rows.keys(), f"{len(wanted.keys() - rows.keys())} lost")
        self.check(f"{what}: none more", not rows.keys() - wanted.keys(), f"{len(rows.keys() - wanted.keys())} more")
        self.check(f"{what}: none twice", len(lines) == len(rows), f"{len(lines)} lines, {len(rows)} episodes")
        different = [key for key in wanted.keys() & rows.keys() if wanted[key] != rows[key]]
        self.check(f"{what}: equal bit for bit", not different, f"{len(different)} differ")
        litter = [name for _, _, names in os.walk(run) for name in names if ".part-" in name]
        self.check(f"{what}: nothing half-written is left", not litter, litter)


def run_trials(trials, only):
    for trial in faults.SHORT if trials.short else faults.ALL:
        if only and only not in trial.__name__:
            continue
        if trials.nodes is None and trial in faults.NEED_SLURM:
            print(f"{trial.__name__}: SKIPPED (Slurm does not start here)", flush=True)
            continue
        print(f"{trial.__name__}: {trial.__doc__}", flush=True)
        begin = time.monotonic()
        trial(trials)
        print(f"  {time.monotonic() - begin:.1f} s", flush=True)


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
    print(f"{trials.passed} passed, {trials.failed} failed")
    sys.exit(1 if trials.failed else 0)


if __name__ == "__main__":
    main()
