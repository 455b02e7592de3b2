import copy
import gc
import multiprocessing
import os
import pickle
import sys
import tracemalloc
import unittest
import weakref

import numpy

import duet
from support import ScratchTest, main_arm

KEPT = "record: {trajectories: all}\n"


class Views(ScratchTest):
    def recording(self):
        run = duet.evaluate(None, self.suite(more=KEPT), output=self.path("run"))
        row = main_arm(run)[0]
        return run, run.recording(row["key"]), row

    def test_a_recording_is_read_only_views_without_copies(self):
        _, recording, row = self.recording()
        frames = row["frames"]
        for name, shape in (("q", (frames, 29)), ("v", (frames, 29)), ("root_position", (frames, 3)),
                            ("root_quat_wxyz", (frames, 4)), ("partner", (frames, 24, 3)), ("q_target", (frames, 29))):
            with self.subTest(name):
                first, second = getattr(recording, name), recording[name]
                self.assertEqual(first.shape, shape)
                self.assertEqual(first.dtype, numpy.float64)
                self.assertFalse(first.flags.writeable)
                self.assertFalse(first.flags.owndata)
                self.assertTrue(numpy.shares_memory(first, second))
                with self.assertRaises(ValueError):
                    first[0] = 1.0
                with self.assertRaises(ValueError):
                    first.flags.writeable = True
        self.assertEqual(recording.rate_hz, 50.0)
        self.assertEqual(recording.outcome, "ok")
        self.assertEqual(recording.row["key"], row["key"])
        file = numpy.load(self.path("run/trajectories/" + row["key"][:16] + ".npz"))
        self.assertTrue((recording.q == file["q"]).all())
        self.assertTrue((recording.partner == file["partner"]).all())

    def test_no_view_copies_more_than_a_kilobyte(self):
        _, recording, _ = self.recording()
        self.assertGreater(recording.partner.nbytes, 100_000)
        for key in recording.keys():
            recording[key]
        tracemalloc.start()
        self.addCleanup(tracemalloc.stop)
        for key in ("q", "v", "partner", "q_target", "reference_q", "root_position", "contact_force"):
            before = tracemalloc.get_traced_memory()[0]
            view = recording[key]
            self.assertLess(tracemalloc.get_traced_memory()[0] - before, 1024, key)
            del view

    def test_a_view_keeps_its_recording_alive_and_nothing_longer(self):
        _, recording, _ = self.recording()
        total = recording.q.sum()
        kept = recording.q
        archive = recording._archive
        references = sys.getrefcount(archive)
        views = [recording.q for _ in range(100)]
        self.assertEqual(sys.getrefcount(archive), references + 100)
        del views
        self.assertEqual(sys.getrefcount(archive), references)
        gone = weakref.ref(recording)
        del recording, archive
        gc.collect()
        self.assertIsNone(gone())
        self.assertEqual(kept.sum(), total)
        part = kept[3:7, ::2]
        del kept
        gc.collect()
        self.assertEqual(part.shape, (4, 15))
        self.assertTrue(numpy.isfinite(part).all())

    def test_a_recording_that_is_not_there_says_what_keeps_them(self):
        run = duet.evaluate(None, self.suite(), output=self.path("bare"))
        with self.assertRaisesRegex(duet.MissingError, "trajectories: all"):
            run.recording(run.episodes[0]["key"])
        with self.assertRaisesRegex(KeyError, "expected one episode whose key begins with 'zz', found 0"):
            run.recording("zz")

    def test_a_file_of_another_schema_is_refused_by_name(self):
        numpy.savez(self.path("other.npz"), schema="somebody.recording", schema_version=1, q=numpy.zeros((2, 29)))
        with self.assertRaisesRegex(duet.InputError, "other.npz.*somebody.recording"):
            duet.load(self.path("other.npz"))
        _, recording, row = self.recording()
        arrays = dict(numpy.load(self.path("run/trajectories/" + row["key"][:16] + ".npz")))
        arrays["schema_version"] = numpy.array(99)
        numpy.savez(self.path("newer.npz"), **arrays)
        with self.assertRaisesRegex(duet.InputError, "newer.npz.*version 1.*version 99"):
            duet.load(self.path("newer.npz"))
        with self.assertRaisesRegex(duet.InputError, "absent.npz"):
            duet.load(self.path("absent.npz"))
        with open(self.path("text.npz"), "w", encoding="utf-8") as file:
            file.write("not an archive")
        with self.assertRaisesRegex(duet.InputError, "text.npz"):
            duet.load(self.path("text.npz"))
        with self.assertRaisesRegex(duet.InputError, "'no_such_key'"):
            recording["no_such_key"]


class Scores(ScratchTest):
    def test_retargeting_and_scores_are_those_of_the_command_line(self):
        people = duet.synthesize("handshake", seed=42)
        people.save(self.path("clip.npz"))
        self.command("retarget", self.path("clip.npz"), "-o", self.path("paired.npz"), "-q", "--option", "mode=best")
        mine = duet.retarget(people, options={"mode": "best"})
        theirs = duet.load(self.path("paired.npz"))
        self.assertEqual(mine.keys(), theirs.keys())
        for key in ("robot_q", "robot_root_position", "partner_joints"):
            self.assertTrue((mine[key] == theirs[key]).all(), key)
        import json
        listed = json.loads(self.command("score", self.path("paired.npz"), "--json", "-q"))["clips"][0]
        listed.pop("clip")
        scored = duet.score(mine)
        self.assertEqual(scored.pop("clip"), people.id)
        self.assertEqual(scored, listed)
        self.assertEqual(duet.score(self.path("paired.npz"))["metrics"], scored["metrics"])
        for version, name in (("robot", "robot_detected"), ("paper", "paper_detected")):
            detected = duet.detect(mine, "handshake", version=version)
            self.assertEqual(detected["success"], scored[name])
            self.assertEqual(len(detected["frames"]), mine.q.shape[0])
        self.assertEqual(duet.detect(people, "handshake")["success"], scored["source_detected"])

    def test_arrays_of_two_people_are_a_clip(self):
        people = duet.synthesize("hug", seed=7)
        act = tuple(int(frame) for frame in people.phases)
        again = duet.clip(people.a, people.b, rate_hz=50.0, task="hug", act=act, id=people.id)
        self.assertTrue((again.a == people.a).all() and (again.b == people.b).all())
        self.assertTrue((duet.retarget(people.a, people.b, rate_hz=50, task="hug", act=act).q.shape[1] == 29))
        half = duet.clip(people.a[::2].astype(numpy.float32), people.b[::2], rate_hz=25, task="hug")
        self.assertEqual(half.rate_hz, 25.0)
        self.assertLess(half.phases[0], half.phases[1])

    def test_bad_people_are_refused_with_their_place(self):
        people = duet.synthesize("wave")
        broken = people.a.copy()
        broken[3, 4] = numpy.nan
        for a, options, error, pattern in (
                (people.a[:, :22], {}, ValueError, r"a: expected joints of shape \(frames, 24, 3\), found \(.*22, 3\)"),
                (broken, {}, ValueError, "frame 3.*(nan|finite)"),
                (people.a[:-5], {}, ValueError, "frames"),
                (people.a, {"task": "waltz"}, ValueError, "waltz"),
                (people.a, {"reactor": "C"}, ValueError, "reactor: expected A or B, found 'C'"),
                (people.a, {"rate_hz": 0.0}, ValueError, "rate")):
            with self.subTest(pattern), self.assertRaisesRegex(error, pattern):
                duet.clip(a, people.b, **{"rate_hz": 50.0, "task": "wave", **options})
        with self.assertRaisesRegex(ValueError, "a clip, or joints of two people and a task"):
            duet.retarget(people.a, people.b)
        with self.assertRaisesRegex(ValueError, "modus"):
            duet.retarget(people, options={"modus": "best"})
        with self.assertRaisesRegex(ValueError, "expected a clip of two people, found a paired"):
            duet._duet.retarget(duet.retarget(people)._archive, {}, "", "")
        with self.assertRaisesRegex(duet.MissingError, "no_such_robot"):
            duet.retarget(people, robot="no_such_robot")
        with self.assertRaisesRegex(ValueError, "version: expected robot or paper, found 'mine'"):
            duet.detect(people, "wave", version="mine")
        for seed, pattern in ((-1, "seed: expected a number from 0 to 18446744073709551615, found -1"),
                              (0.5, "seed: expected a whole number, found 0.5")):
            with self.assertRaisesRegex(ValueError, pattern):
                duet.synthesize("wave", seed=seed)


class Doors(ScratchTest):
    """People of others are judged where they come in, as the command line judges them."""

    def test_people_who_cannot_be_are_refused_at_every_door_unless_taken_as_they_are(self):
        people = duet.synthesize("hug", seed=7)
        a, b = people.a, people.b
        turned = lambda x: x[..., [0, 2, 1]] * [1.0, 1.0, 1.0]  # y up
        for name, change, pattern in (
                ("millimetres", lambda x: 1000.0 * x, "millimetre"), ("centimetres", lambda x: 100.0 * x, "centimetre"),
                ("inches", lambda x: x / 0.0254, "inch"), ("y up", turned, "up"), ("upside down", lambda x: -x, "up"),
                ("below the floor", lambda x: x - [0.0, 0.0, 3.0], "floor")):
            with self.subTest(name):
                for door in (lambda **o: duet.clip(change(a), change(b), rate_hz=50, task="hug", **o),
                             lambda **o: duet.retarget(change(a), change(b), rate_hz=50, task="hug", **o)):
                    with self.assertRaisesRegex(duet.InputError, f"{pattern}.*as_is=True"):
                        door()
                taken = duet.clip(change(a), change(b), rate_hz=50, task="hug", as_is=True)
                taken.save(self.path("taken.npz"))
                for door in (duet.load, duet.score):
                    with self.assertRaisesRegex(duet.InputError, f"taken.npz.*{pattern}.*as_is=True"):
                        door(self.path("taken.npz"))
                self.assertTrue((duet.load(self.path("taken.npz"), as_is=True).a == taken.a).all())
        duet.score(self.path("taken.npz"), as_is=True)
        duet.retarget(taken)
        for task in duet.tasks():
            people = duet.synthesize(task, seed=3)
            duet.clip(people.a, people.b, rate_hz=50, task=task)

    def test_what_a_file_does_not_say_is_said_beside_it(self):
        people = duet.synthesize("hug", seed=3)
        joints = numpy.stack([people.a, people.b], axis=1)
        names = numpy.array(list(people["human_joint_names"]))
        numpy.savez(self.path("bare.npz"), positions=joints, joints=names)
        with self.assertRaisesRegex(duet.InputError, "rate"):
            duet.read_people(self.path("bare.npz"), task="hug")[0]
        (clip,) = duet.read_people(self.path("bare.npz"), task="hug", rate=50)
        self.assertLess(numpy.abs(clip.a - people.a).max(), 0.05)
        numpy.savez(self.path("other.npz"), positions=1000.0 * joints[..., [0, 2, 1]] * [1, 1, -1], joints=names, rate_hz=50.0)
        (clip,) = duet.read_people(self.path("other.npz"), task="hug", up="y", unit=0.001, reactor="A")
        self.assertEqual(clip.reactor, "A")
        self.assertAlmostEqual(numpy.abs(clip.a[0, 0] - clip.a[0, 15]).max(), numpy.abs(people.a[0, 0] - people.a[0, 15]).max(), 1)
        with self.assertRaisesRegex(ValueError, "up axis: expected x, y, z, -x, -y or -z, found 'w'"):
            duet.read_people(self.path("bare.npz"), up="w")


class Pickles(ScratchTest):
    def test_motions_come_back_from_another_process_to_the_bit(self):
        clip = duet.synthesize("wave", seed=2)
        paired = duet.retarget(clip)
        duet.write_robot_motion(paired, self.path("motion.pkl"), format="gmr")
        run = duet.evaluate(None, self.suite(more=KEPT), output=self.path("run"))
        recording = run.recording(main_arm(run)[0]["key"])
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            for motion in (clip, paired, recording, duet.read_robot_motion(self.path("motion.pkl"))):
                there = pool.apply(copy.copy, (motion,))
                self.assertIs(type(there), type(motion))
                self.assertEqual((there.keys(), there.kind, repr(there)), (motion.keys(), motion.kind, repr(motion)))
                for key in motion.keys():
                    self.assertTrue(numpy.array_equal(there[key], motion[key]), key)

    def test_runs_and_readers_come_back_by_their_path(self):
        run = duet.evaluate(None, self.suite(), output=self.path("run"))
        there = pickle.loads(pickle.dumps(run))
        self.assertEqual((there.episodes, there.summary), (run.episodes, run.summary))
        people = duet.synthesize("hug", seed=3)
        numpy.savez(self.path("take.npz"), positions=numpy.stack([people.a, people.b], axis=1),
                    joints=numpy.array(list(people["human_joint_names"])))
        takes = duet.read_people(self.path("take.npz"), task="hug", rate=50)
        self.assertTrue((pickle.loads(pickle.dumps(takes))[0].a == takes[0].a).all())


class DataSets(ScratchTest):
    def test_robot_motions_go_out_and_come_back_in_formats_of_others(self):
        motion = duet.retarget(duet.synthesize("wave"))
        self.assertIn("gmr", duet.robot_motion_formats())
        duet.write_robot_motion(motion, self.path("motion.pkl"), format="gmr")
        back = duet.read_robot_motion(self.path("motion.pkl"))
        self.assertEqual(back["format"], "gmr")
        self.assertEqual(back.joint_names, motion.joint_names)
        self.assertLess(numpy.abs(back.q - motion.q).max(), 1e-6)
        duet.write_robot_motion(back, self.path("again.pkl"), format="gmr")
        with self.assertRaisesRegex(ValueError, "nobodys"):
            duet.write_robot_motion(motion, self.path("x"), format="nobodys")

    def test_recordings_of_people_are_read_one_by_one(self):
        people = duet.synthesize("hug", seed=3)
        joints = numpy.stack([people.a, people.b], axis=1)
        names = numpy.array(list(people["human_joint_names"]))
        os.mkdir(self.path("takes"))
        for name in ("one", "two"):
            numpy.savez(self.path(f"takes/{name}.npz"), positions=joints, rate_hz=50.0, joints=names)
        takes = duet.read_people(self.path("takes"), task="hug")
        self.assertEqual(len(takes), 2)
        self.assertEqual([clip.task for clip in takes], ["hug", "hug"])
        self.assertLess(numpy.abs(takes[-1].a - people.a).max(), 0.05)
        self.assertTrue(takes[0].evidence)
        with self.assertRaises(IndexError):
            takes[2]

    def test_what_is_there_is_listed(self):
        self.assertIn("demo", duet.suites())
        self.assertIn("handshake", duet.tasks())
        self.assertIn("dstar", [policy["name"] for policy in duet.policies()])
        self.assertEqual([engine["name"] for engine in duet.engines()][:5], ["mujoco", "bullet", "ode", "simbody", "dart"])
        with self.assertRaisesRegex(duet.InputError, "no_data_set"):
            duet.dataset(self.path("no_data_set"))


if __name__ == "__main__":
    unittest.main()
