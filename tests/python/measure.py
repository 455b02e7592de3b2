"""Prints the figures of docs/using-duet.md: what a policy of Python costs, and how long the import takes.

    PYTHONPATH=build/release/python python3 tests/python/measure.py [ENGINE] [EPISODES] [REPETITIONS]

Pairs of runs of the same episodes, one under the null policy of C++ and one under a function of Python that answers the
same, in turns; processor time of the whole process and wall time of each. The null arm is off.
"""

import os
import statistics
import subprocess
import sys
import tempfile
import time

import duet

SUITE = """schema: duet.suite/1
name: cost
version: 1.0.0
clips: {{synth: {{per_task: {clips}}}}}
tasks: [wave, handshake, hug, bend]
engines: [{engine}]
controllers: [vmc]
policies: [{{name: still, use: 'null'}}]
start: act
null_arm: false
"""


def hold(observations):
    return observations.hold()


def timed(policy, suite, folder, jobs):
    wall, processor = time.perf_counter(), time.process_time()
    duet.evaluate(policy, suite, output=folder, jobs=jobs)
    return time.process_time() - processor, time.perf_counter() - wall


def main(engine="mujoco", episodes="64", repetitions="3"):
    jobs = int(episodes)
    with tempfile.TemporaryDirectory() as scratch:
        suite = os.path.join(scratch, "suite.yaml")
        with open(suite, "w", encoding="utf-8") as file:
            file.write(SUITE.format(engine=engine, clips=max(1, jobs // 4)))
        pairs = []
        for i in range(int(repetitions) + 1):
            cpp = timed("still", suite, os.path.join(scratch, f"cpp{i}"), jobs)
            python = timed(hold, suite, os.path.join(scratch, f"python{i}"), jobs)
            if i == 0:
                continue  # engines and networks are loaded by the first
            pairs.append((cpp, python))
            print(f"{engine}, {jobs} episodes at once: C++ {cpp[0]:.2f} s processor, {cpp[1]:.2f} s wall; "
                  f"Python {python[0]:.2f} s, {python[1]:.2f} s", flush=True)
    for place, name in ((0, "processor time"), (1, "wall time")):
        ratios = [python[place] / cpp[place] - 1.0 for cpp, python in pairs]
        print(f"overhead, {name}: median {100 * statistics.median(ratios):+.1f} % of {len(ratios)} pairs "
              f"({', '.join(f'{100 * ratio:+.1f}' for ratio in ratios)})")
    script = ("import time; a, b = time.perf_counter(), time.process_time(); import duet; "
              "print(1000 * (time.perf_counter() - a), 1000 * (time.process_time() - b))")
    imports = [list(map(float, subprocess.run([sys.executable, "-c", script], capture_output=True, text=True,
                                              check=True).stdout.split())) for _ in range(10)]
    print(f"import: median {statistics.median(wall for wall, _ in imports):.0f} ms wall, "
          f"{statistics.median(processor for _, processor in imports):.0f} ms processor, of 10")


if __name__ == "__main__":
    main(*sys.argv[1:])
