import importlib.util
import multiprocessing
import os
import socket
import sys
import threading
import unittest
import warnings

import numpy

import duet
from duet._identity import identity_of
from pairs import PAIRS, Instance, cell, closure
from support import ScratchTest, main_arm

DROPS = (0.0, 0.2)
CHOSEN = {"tasks": ["wave"], "jobs": 1}


def drop_in(folder, suite, drop):
    """For another process: a row's figure."""
    run = duet.evaluate(Instance(drop), suite, output=folder, **CHOSEN)
    return main_arm(run)[0]["metrics"]["jpe"]


class Rows(ScratchTest):
    """What is asserted is the figure of each row: the policy whose name it has was called, and no other."""

    def alone(self, drop):
        run = duet.evaluate(Instance(drop), self.suite(name="alone.yaml"), output=self.path(f"alone{drop}"), **CHOSEN)
        (row,) = main_arm(run)
        return row["metrics"]["jpe"]

    def test_no_pair_of_policies_has_mixed_rows(self):
        alone = {drop: self.alone(drop) for drop in DROPS}
        self.assertGreater(alone[0.2] - alone[0.0], 0.05)
        asked, expected = {}, {}
        for number, make in enumerate(PAIRS.values()):
            for drop in DROPS:
                asked[f"p{number}_{drop}".replace(".", "_")] = make(drop)
                expected[f"p{number}_{drop}".replace(".", "_")] = alone[drop]
        run = duet.evaluate(asked, self.suite(), output=self.path("run"), tasks=["wave"], jobs=4)
        found = {row["policy"]: row["metrics"]["jpe"] for row in main_arm(run)}
        self.assertGreaterEqual(len(PAIRS), 40)
        self.assertEqual(set(found), set(expected))
        mixed = [(list(PAIRS)[int(name.split("_")[0][1:])], name) for name in expected
                 if abs(found[name] - expected[name]) > 1e-4]
        self.assertEqual(mixed, [])

    def test_the_order_of_two_policies_and_the_jobs_do_not_matter(self):
        alone = {drop: self.alone(drop) for drop in DROPS}
        for jobs in (1, 4):
            for first, second in (DROPS, DROPS[::-1]):
                run = duet.evaluate({"first": Instance(first), "second": Instance(second)}, self.suite(), tasks=["wave"],
                                    jobs=jobs, output=self.path(f"run{jobs}{first}"))
                found = {row["policy"]: row["metrics"]["jpe"] for row in main_arm(run)}
                self.assertEqual(found, {"first": alone[first], "second": alone[second]})

    def test_evaluations_on_threads_keep_to_their_own(self):
        drops, found = (0.0, 0.1, 0.2), {}
        suite = self.suite()

        def work(drop):
            found[drop] = drop_in(self.path(f"run{drop}"), suite, drop)
        threads = [threading.Thread(target=work, args=(drop,)) for drop in drops]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(found, {drop: self.alone(drop) for drop in drops})

    def test_processes_keep_to_their_own(self):
        suite = self.suite()
        with multiprocessing.get_context("spawn").Pool(2) as pool:
            found = pool.starmap(drop_in, [(self.path(f"run{drop}"), suite, drop) for drop in DROPS])
        self.assertEqual(found, [self.alone(drop) for drop in DROPS])

    def test_a_sweep_into_one_folder_is_refused_with_the_ways_out(self):
        suite = self.suite()
        for name, make in (("attribute", Instance), ("closure", closure), ("edited", PAIRS["edited constant"]),
                           ("global", PAIRS["global"])):
            with self.subTest(name):
                duet.evaluate(make(0.0), suite, output=self.path(name), name="mine", **CHOSEN)
                with self.assertRaisesRegex(duet.InputError, r"another policy 'mine'.*output=.*replace=True.*version="):
                    duet.evaluate(make(0.2), suite, output=self.path(name), name="mine", **CHOSEN)

    def test_replaced_rows_are_those_of_the_new_policy_and_the_others_stay(self):
        suite, folder = self.suite(more="record: {trajectories: all}\n"), self.path("run")
        first = duet.evaluate({"mine": Instance(0.0), "other": Instance(0.1)}, suite, output=folder, **CHOSEN)
        run = duet.evaluate({"mine": Instance(0.2)}, suite, output=folder, replace=True, **CHOSEN)
        figures = {row["policy"]: row["metrics"]["jpe"] for row in main_arm(run)}
        self.assertEqual(figures, {"mine": self.alone(0.2), "other": self.alone(0.1)})
        self.assertEqual(len(run.episodes), len(first.episodes))
        self.assertEqual(len(os.listdir(os.path.join(folder, "trajectories"))), len(run.episodes))
        source = next(row["policy_digest"] for row in main_arm(run) if row["policy"] == "mine")
        self.assertEqual(duet.load_run(folder).info["policies"]["mine"], source)
        again = duet.evaluate({"mine": Instance(0.2), "other": Instance(0.1)}, suite, output=folder, replace=True, **CHOSEN)
        self.assertEqual(again.summary["run_now"], 0)
        self.command("report", folder, "-o", self.path("report.html"))

    def test_rows_that_were_there_are_said(self):
        suite = self.suite()
        first = {"output": self.path("run"), "name": "mine"}
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)
            duet.evaluate(Instance(0.0), suite, tasks=["wave"], **first)
        with self.assertWarnsRegex(RuntimeWarning, "policy 'mine': 1 row was there; the function was not called"):
            duet.evaluate(Instance(0.0), suite, tasks=["wave"], **first)
        with self.assertWarnsRegex(RuntimeWarning, "policy 'mine': 1 row was there; the function was called for the others"):
            duet.evaluate(Instance(0.0), suite, **first)
        with self.assertWarnsRegex(RuntimeWarning, "policy 'mine': 2 rows were there; the function was not called"):
            duet.evaluate(Instance(0.0), suite, **first)

    def test_two_that_are_one_are_refused_until_they_are_told_apart(self):
        suite = self.suite()
        two = {"a": Instance(0.0), "b": Instance(0.0)}
        for version in (None, "1", {"a": "1", "b": "1"}):
            with self.assertRaisesRegex(ValueError, r"policies 'a' and 'b' are one policy.*version=\{'a': '0', 'b': '1'\}"):
                duet.evaluate(two, suite, output=self.path("run"), version=version, **CHOSEN)
        run = duet.evaluate(two, suite, output=self.path("run"), version={"a": "0", "b": "1"}, **CHOSEN)
        self.assertEqual(len({row["key"] for row in main_arm(run)}), 2)

    def test_versions_stand_for_data_and_not_for_code(self):
        name = lambda drop, version: identity_of("p", Instance(drop), version)
        self.assertEqual(name(0.0, "1"), name(0.2, "1"))
        self.assertNotEqual(name(0.0, "1"), name(0.0, "2"))
        edited = PAIRS["edited constant"]
        self.assertNotEqual(identity_of("p", edited(0.0), "1"), identity_of("p", edited(0.2), "1"))

    def test_wrong_versions_are_refused(self):
        for version, pattern in (({"b": "1"}, "names of functions .a., found 'b'"), (3, "version: expected a text"),
                                 ({"a": 3}, "version: expected a text")):
            with self.subTest(version), self.assertRaisesRegex(ValueError, pattern):
                duet.evaluate({"a": Instance(0.0)}, self.suite(), output=self.path("run"), version=version)


class Identities(unittest.TestCase):
    def test_each_pair_is_two_and_each_policy_one(self):
        for name, make in PAIRS.items():
            with self.subTest(name):
                low, none = make(0.2), make(0.0)
                self.assertNotEqual(identity_of("p", none, None), identity_of("p", low, None))
                self.assertEqual(identity_of("p", none, None), identity_of("p", none, None))
                self.assertEqual(identity_of("p", none, None), identity_of("p", make(0.0), None))

    def test_another_process_says_the_same(self):
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            there = dict(pool.map(in_this_process, sorted(PAIRS)))
        for name, one in there.items():
            self.assertEqual(one, in_this_process(name)[1], name)

    def test_comments_and_places_are_no_part(self):
        plain = cell(0.0, "def policy(o):\n    return o.hold()\n")
        said = cell(0.0, "# a remark\n\n\ndef policy(o):  # another\n    # and one more\n    return  o.hold()\n")
        self.assertEqual(identity_of("p", plain, None), identity_of("p", said, None))

    def test_a_file_that_was_edited_and_loaded_again_is_another(self):
        import tempfile

        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "mine.py")
            ones = []
            for drop in DROPS:
                with open(path, "w", encoding="utf-8") as file:
                    file.write(f"import helper_of_mine\ndef policy(o):\n    return o.hold() - helper_of_mine.by()\n")
                with open(os.path.join(folder, "helper_of_mine.py"), "w", encoding="utf-8") as file:
                    file.write(f"def by():\n    return {drop!r}\n")
                sys.path.insert(0, folder)
                self.addCleanup(sys.path.remove, folder)
                sys.modules.pop("helper_of_mine", None)
                importlib.invalidate_caches()
                sys.dont_write_bytecode, before = True, sys.dont_write_bytecode
                spec = importlib.util.spec_from_file_location("mine", path)
                module = importlib.util.module_from_spec(spec)
                spec.loader.exec_module(module)
                sys.dont_write_bytecode = before
                ones.append(identity_of("p", module.policy, None))
            self.assertNotEqual(*ones)

    def test_a_package_of_site_packages_counts_by_its_files(self):
        import tempfile

        with tempfile.TemporaryDirectory() as folder:
            ones = []
            for drop in DROPS:
                place = os.path.join(folder, f"at{drop}", "site-packages")
                os.makedirs(os.path.join(place, "installed_of_mine"))
                with open(os.path.join(place, "installed_of_mine", "__init__.py"), "w", encoding="utf-8") as file:
                    file.write("class Policy:\n    def __call__(self, o):\n        return by(o)\nfrom .inner import by\n")
                with open(os.path.join(place, "installed_of_mine", "inner.py"), "w", encoding="utf-8") as file:
                    file.write(f"def by(o):\n    return o.hold() - {drop!r}\n")
                sys.path.insert(0, place)
                for name in ("installed_of_mine", "installed_of_mine.inner"):
                    sys.modules.pop(name, None)
                importlib.invalidate_caches()
                import installed_of_mine

                ones.append(identity_of("p", installed_of_mine.Policy(), None))
                sys.path.remove(place)
            self.assertNotEqual(*ones)

    def test_what_shows_no_state_is_asked_for(self):
        opened = open(os.devnull, encoding="utf-8")
        self.addCleanup(opened.close)
        connection = socket.socket()
        self.addCleanup(connection.close)
        for name, held in (("file", opened), ("socket", connection), ("generator", (i for i in range(3))),
                           ("thread's own", threading.local()), ("frame", sys._getframe()),
                           ("in a list", [opened]), ("in an object", Instance(opened))):
            policy = Instance(held)
            with self.subTest(name):
                with self.assertRaisesRegex(ValueError, r"policy 'mine': .*policy\.drop.*version='\.\.\.'"):
                    identity_of("mine", policy, None)
                self.assertNotEqual(identity_of("mine", policy, "1"), identity_of("mine", policy, "2"))

    def test_what_is_read_while_it_is_called_is_asked_for(self):
        def of_file(observations):
            with open("weights.txt", encoding="utf-8") as file:
                return observations.hold() - float(file.read())

        def of_environment(observations):
            return observations.hold() - float(os.environ["GAIN"])

        def of_array(observations):
            return observations.hold() - numpy.load("weights.npy")

        def of_names(observations):
            return observations.hold() - globals()["GAIN"]

        def of_text(observations):
            return observations.hold() - eval("GAIN")

        def of_server(observations):
            return socket.create_connection(("localhost", 1)).recv(8)

        def through_another(observations):
            return of_file(observations)

        class InMethod:
            def __call__(self, observations):
                return self.plan(observations)

            def plan(self, observations):
                return of_array(observations)

        class Reader:
            def __init__(self):
                self.weights = numpy.load("weights.npy")

        def through_an_object(observations):
            return observations.hold() - Reader().weights
        for policy in (of_file, of_environment, of_array, of_names, of_text, of_server, through_another, InMethod(),
                       through_an_object):
            with self.subTest(policy), self.assertRaisesRegex(ValueError, "known only when it is called"):
                identity_of("mine", policy, None)

    def test_what_was_read_before_it_is_called_is_data(self):
        class Policy:
            def __init__(self, path):
                self.weights = numpy.load(path) if path else numpy.zeros(3)

            @classmethod
            def from_file(cls, path):
                with open(path, encoding="utf-8") as file:
                    return cls(file.read())

            def save(self, path):
                with open(path, "w", encoding="utf-8") as file:
                    file.write(str(self.weights))

            def __call__(self, observations):
                return observations.hold() - self.weights.sum()
        identity_of("mine", Policy(None), None)

    def test_locks_loggers_and_modules_are_no_hindrance(self):
        import logging

        class Policy:
            def __init__(self):
                self.lock, self.event, self.condition = threading.Lock(), threading.Event(), threading.Condition()
                self.log, self.out, self.numpy = logging.getLogger("mine"), sys.stdout, numpy

            def __call__(self, observations):
                self.log.info("called")
                with self.lock:
                    return observations.hold()
        self.assertEqual(identity_of("p", Policy(), None), identity_of("p", Policy(), None))

    def test_what_duet_makes_may_be_held(self):
        clips = [duet.synthesize("wave", seed=seed) for seed in (1, 2)]
        self.assertNotEqual(*[identity_of("p", Instance(clip), None) for clip in clips])
        self.assertEqual(identity_of("p", Instance(clips[0]), None),
                         identity_of("p", Instance(duet.synthesize("wave", seed=1)), None))

    def test_what_holds_itself_deeply_is_a_sentence(self):
        deep = []
        for _ in range(100000):
            deep = [deep]
        with self.assertRaisesRegex(ValueError, "more inside one another"):
            identity_of("mine", Instance(deep), None)
        while deep:
            deep = deep.pop()


def in_this_process(name):
    return name, identity_of("p", PAIRS[name](0.2), None)


if __name__ == "__main__":
    unittest.main()
