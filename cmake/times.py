#!/usr/bin/env python3
"""What building and starting cost on this machine: `./run times`.

Job seconds are those that ninja noted for the build that is there, the last one of each output: on as many idle cores as
there are jobs they are CPU seconds. A file that ccache had counts as the moment that it took.
"""

import os
import statistics
import subprocess
import sys
import tempfile
import time

BUILD = os.path.join("build", "release")
TRIALS = 5


def job_seconds():
    """Seconds by output, of those that the build still has."""
    listed = subprocess.run(("ninja", "-C", BUILD, "-t", "targets", "all"), check=True, stdout=subprocess.PIPE, text=True)
    outputs = {line.split(": ")[0] for line in listed.stdout.splitlines()}
    seconds = {}
    with open(os.path.join(BUILD, ".ninja_log"), encoding="utf-8") as file:
        for line in file:
            fields = line.rstrip("\n").split("\t")
            if len(fields) == 5 and fields[3] in outputs:
                seconds[fields[3]] = (int(fields[1]) - int(fields[0])) / 1000
    return seconds


def part_folders():
    """Folders of the build that `./run demo` does without: rooms of parts (cmake/rooms.txt), and what adds them."""
    with open(os.path.join("cmake", "rooms.txt"), encoding="utf-8") as file:
        of_parts = file.read().split("\n[", 2)[2]
    return ("parts/", *(line.split(":")[0] + "/" for line in of_parts.splitlines() if ":" in line))


def median_seconds(*command):
    taken = []
    for _ in range(TRIALS):
        begin = time.monotonic()
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        taken.append(time.monotonic() - begin)
    return statistics.median(taken)


def main():
    program = os.path.join(BUILD, "duet")
    if not os.path.exists(program):
        sys.exit("times: build/release/duet is not there; `./run build` makes it")
    jobs = job_seconds()
    tests = sum(seconds for output, seconds in jobs.items() if output.startswith("tests/"))
    product = sum(jobs.values()) - tests
    print(f"| {'what':44} | {'seconds':>8} |\n| :{'-' * 43} | {'-' * 7}: |")
    parts = sum(seconds for output, seconds in jobs.items() if output.startswith(part_folders()))
    rows = [("jobs that compile and link the program", product), ("of them the core, for `./run demo`", product - parts),
            ("jobs that compile and link the tests", tests)]
    with tempfile.TemporaryDirectory() as folder:
        rows.append(("duet --help", median_seconds(program, "--help")))
        for name in ("interaction", "policies"):
            path = os.path.join("results", "published", name)
            with open(os.path.join(path, "episodes.jsonl"), "rb") as file:
                count = sum(1 for _ in file)
            rows.append((f"duet report of {count} rows (md)", median_seconds(program, "report", path, "--no-clips", "-q", "-f", "md", "-o", folder)))
    for what, seconds in rows:
        print(f"| {what:44} | {seconds:8.2f} |")
    print("\nThe slowest jobs:")
    for output, seconds in sorted(jobs.items(), key=lambda job: -job[1])[:10]:
        print(f"  {seconds:6.1f} s {output}")


if __name__ == "__main__":
    main()
