"""What the tests of the package share. Run by tests/python/run_tests.py, which puts the package on the path."""

import os
import subprocess
import tempfile
import unittest

PROGRAM = os.environ["DUET_PROGRAM"]  # the command line that the package is compared with
SOURCE = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))

TINY = """schema: duet.suite/1
name: tiny
version: 1.0.0
clips: {synth: {per_task: %d}}
tasks: [wave, handshake]
engines: [%s]
controllers: [%s]
policies: [%s]
start: act
%s"""


class ScratchTest(unittest.TestCase):
    """With a folder of its own."""

    def setUp(self):
        scratch = tempfile.TemporaryDirectory(prefix="duet-test-")
        self.addCleanup(scratch.cleanup)
        self.folder = scratch.name

    def path(self, name):
        return os.path.join(self.folder, name)

    def suite(self, per_task=1, engines="playback", controllers="pd", policies="replay", more="", name="suite.yaml"):
        with open(self.path(name), "w", encoding="utf-8") as file:
            file.write(TINY % (per_task, engines, controllers, policies, more))
        return self.path(name)

    def command(self, *arguments):
        """The text that the command line prints."""
        ended = subprocess.run([PROGRAM, *arguments], capture_output=True, text=True, check=False)
        self.assertEqual(ended.returncode, 0, ended.stderr)
        return ended.stdout


def repeatable(row):
    """A row without what a clock says."""
    return {key: value for key, value in row.items() if key not in ("wall_s", "started_at", "policy_ms")}


def main_arm(run):
    return [row for row in run.episodes if row["arm"] == "main"]
