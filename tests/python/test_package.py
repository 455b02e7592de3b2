import ast
import os
import subprocess
import sys
import unittest

import duet
from support import SOURCE, ScratchTest

PACKAGE = os.path.dirname(os.path.abspath(duet.__file__))


class Package(unittest.TestCase):
    def python(self, script):
        ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
        self.assertEqual(ended.returncode, 0, ended.stderr)
        return ended.stdout

    def test_import_loads_nothing_that_is_slow(self):
        loaded = self.python("import sys, duet; print(*[name for name in ('numpy', 'inspect', 'gymnasium', 'pandas', "
                             "'torch', 'asyncio', 'multiprocessing') if name in sys.modules])")
        self.assertEqual(loaded, "\n")

    def test_everything_that_is_named_is_there_and_explained(self):
        for name in duet.__all__:
            self.assertTrue(hasattr(duet, name), name)
        for name in ("evaluate", "retarget", "score", "detect", "make_env", "make_vec_env", "Batch", "Run", "load"):
            self.assertTrue(getattr(duet, name).__doc__, name)

    def test_nothing_of_it_names_the_folder_of_its_build(self):
        module = duet._duet.__file__
        engines = [engine["name"] for engine in duet.engines() if engine["available"]]
        self.assertTrue(engines)  # those of the build folder are found all the same
        with open(module, "rb") as file:
            self.assertNotIn(SOURCE.encode() + b"/", file.read())

    def test_interpreters_end_while_a_policy_is_stuck(self):
        self.python("import threading, duet\nqueue = duet._duet.PlanQueue('x', 0.0, 1.0)\n"
                    "threading.Thread(target=queue.take, args=(3600.0,), daemon=True).start()\n")


# A user's own code, which mypy judges strictly: arrays have their types.
STRICT = """import numpy
import duet

Numbers = numpy.ndarray[object, numpy.dtype[numpy.float64]]


def policy(observations: duet.Observations) -> Numbers:
    plans = observations.hold()
    plans[:, :, 2] -= observations.frames[:, -1, :1] * 0.0
    return plans


def longest(people: duet.Clip, motion: duet.Paired, recording: duet.Recording) -> Numbers:
    return max(people.a, motion.q, recording.v, key=len)
"""


class Stubs(ScratchTest):
    def names_of(self, path):
        """Functions, classes and their methods of a module or stub."""
        with open(path, encoding="utf-8") as file:
            tree = ast.parse(file.read())
        names = set()
        for node in tree.body:
            if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
                names.add(node.name)
            if isinstance(node, ast.ClassDef):
                names |= {f"{node.name}.{item.name}" for item in node.body if isinstance(item, ast.FunctionDef)}
        return names

    def test_the_stub_of_the_module_says_what_the_module_has(self):
        stub = self.names_of(os.path.join(SOURCE, "python", "duet", "_duet.pyi"))
        has = set()
        for name, value in vars(duet._duet).items():
            if name.startswith("__"):
                continue
            has.add(name)
            if isinstance(value, type) and not issubclass(value, BaseException):
                has |= {f"{name}.{method}" for method in vars(value)
                        if not method.startswith("__") or method in ("__init__", "__len__", "__getitem__", "__contains__")}
        self.assertEqual(has - stub, set())
        self.assertEqual(stub - has, set())

    def test_the_package_and_the_tutorial_pass_mypy(self):
        mypy = "/usr/bin/mypy"
        if not os.path.exists(mypy):
            self.skipTest("not run: mypy absent")
        source = os.path.join(SOURCE, "python")
        ended = subprocess.run([mypy, "--cache-dir", self.path("cache"), "--ignore-missing-imports", "-p", "duet"], cwd=source,
                               capture_output=True, text=True, check=False)
        self.assertEqual(ended.returncode, 0, ended.stdout + ended.stderr)
        with open(self.path("mine.py"), "w", encoding="utf-8") as file:
            file.write(STRICT)
        ended = subprocess.run([mypy, "--strict", "--follow-imports", "silent", "--cache-dir", self.path("cache"), self.path("mine.py")], cwd=source,
                               env={**os.environ, "MYPYPATH": source}, capture_output=True, text=True, check=False)
        self.assertEqual(ended.returncode, 0, ended.stdout + ended.stderr)


class Tutorial(ScratchTest):
    def test_the_tutorial_runs_and_says_what_it_promises(self):
        tutorial = os.path.join(SOURCE, "examples", "python", "tutorial.py")
        with open(tutorial, encoding="utf-8") as file:
            self.assertLessEqual(len(file.readlines()), 65)
        ended = subprocess.run([sys.executable, tutorial, self.path("run")], capture_output=True, text=True, check=False)
        self.assertEqual(ended.returncode, 0, ended.stderr)
        for sentence in ("a wave, says the detector: True", "raise vs hold", "standing still is no wave: False"):
            self.assertIn(sentence, ended.stdout)


if __name__ == "__main__":
    unittest.main()
