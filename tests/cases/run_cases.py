#!/usr/bin/env python3
"""Runs the cases of public bug reports (../shared/cases/manifest.csv) against the program, with the right answer of each as its check.

  python3 tests/cases/run_cases.py --program build/release/duet [--package build/release/python] [ID...]

Prints one line per id: passed, failed with what was found, or not run with what is absent. Ends with 1 where a case fails that is not in
EXPECTED_TO_FAIL, and where the manifest has a case without a check here or the other way round. The files are read where they are
(DUET_SHARED or ../shared) and never changed; what is written goes to a scratch folder that is removed.
"""
import argparse
import ast
import csv
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import types
import zipfile

from arrays import farthest, read_npz

ROOT = pathlib.Path(__file__).resolve().parents[2]
# Ids that are known to fail; whoever mends one takes it off. A case that passes though it stands here is said.
EXPECTED_TO_FAIL = set()
SAME_JOINTS = 1e-6  # [m] or [rad]: two readings of the same numbers
G1_LEGS = [f"{side}_{joint}_joint" for side in ("left", "right")
           for joint in ("hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll")]
CASES = {}


class Wrong(Exception):
    """The program did not do as it should: what it did instead."""


class Absent(Exception):
    """What a case needs and this machine lacks."""


def case(name):
    def add(check):
        CASES[name] = check
        return check

    return add


def expect(holds, found):
    if not holds:
        raise Wrong(found)


def last_line(text):
    lines = [line for line in text.strip().splitlines() if line.strip()]
    return lines[-1][:300] if lines else "(nothing)"


class Desk:
    """Where one case is tried: the program, the files and a folder of its own."""

    def __init__(self, program, package, files, scratch):
        self.program, self.package, self.files, self.scratch = program, package, files, scratch

    def file(self, name):
        path = self.files / name
        if not path.exists():
            raise Absent(f"{path} absent")
        return str(path)

    def run(self, command, **options):
        done = subprocess.run([str(part) for part in command], cwd=self.scratch, capture_output=True, text=True, errors="replace",
                              timeout=600, check=False, stdin=subprocess.DEVNULL, **options)
        expect(done.returncode >= 0, f"signal {-done.returncode}")
        return types.SimpleNamespace(rc=done.returncode, out=done.stdout, err=done.stderr, said=done.stdout + done.stderr)

    def duet(self, *arguments):
        return self.run([self.program, *arguments])

    def imported(self, *arguments):
        """What `duet import` of these makes: its arrays by name, and what it said."""
        target = self.scratch / f"imported-{len(list(self.scratch.iterdir()))}.npz"
        done = self.duet("import", *arguments, "-o", target)
        expect(done.rc == 0, f"rc {done.rc}: {last_line(done.err)}")
        return read_npz(target), done

    def refused(self, done, *words):
        """Exit code 2, and one sentence on standard error that has all of these words; the names of files do not count."""
        expect(done.rc == 2, f"rc {done.rc}: {last_line(done.said)}")
        sentence = re.sub(r"(/[\w.-]+)+", "FILE", done.err)
        missing = [word for word in words if not re.search(word, sentence, re.IGNORECASE)]
        expect(not missing, f"the sentence lacks {missing}: {last_line(done.err)}")

    def rows(self, suite, *arguments):
        out = self.scratch / f"run-{len(list(self.scratch.iterdir()))}"
        done = self.duet("run", suite, "-o", out, *arguments)
        path = out / "episodes.jsonl"
        rows = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
        return rows, done

    def copied(self, folder):
        """A folder of the cases with files that may be written beside them."""
        target = self.scratch / folder
        if not target.exists():
            shutil.copytree(self.files / folder, target)
            for path in [target, *target.iterdir()]:
                path.chmod(0o755 if path.is_dir() else 0o644)
        return target


def same_motion(found, wanted, keys, tolerance, frames=None):
    for key in keys:
        far = farthest(found[key], wanted[key], frames)
        expect(far <= tolerance, f"{key}: {far:.3g} from what it should be, at most {tolerance:.0e} wanted")


# K1: a robot's motion with the right joints and clock.
def same_robot_motion(desk, name, *arguments):
    found, _ = desk.imported(desk.file(name), *arguments)
    wanted, _ = desk.imported(desk.file("m/u_ref.csv"), "--format", "unitree")
    same_motion(found, wanted, ["q", "root_position", "root_quat_wxyz"], SAME_JOINTS)


@case("K1a")
def names_in_a_header(desk):
    for arguments in (["--format", "unitree"], []):
        done = desk.duet("import", desk.file("m/u_header_isaac.csv"), *arguments, "-o", desk.scratch / "x.npz")
        if done.rc == 0:
            same_robot_motion(desk, "m/u_header_isaac.csv", *arguments)
        else:
            desk.refused(done, "joint|name")


@case("K1b")
def rate_in_a_name(desk):
    motion, _ = desk.imported(desk.file("m/u_119.88hz.csv"))  # 90 frames, brought to 50 Hz
    frames, wanted = len(motion["q"]), round(89 / 119.88 * motion["rate_hz"]) + 1
    expect(abs(frames - wanted) <= 1, f"{frames} frames at {motion['rate_hz']} Hz, expected {wanted}")


@case("K1e")
def order_against_the_soles(desk):
    done = desk.duet("import", desk.file("m/u_isaac_order.csv"), "-o", desk.scratch / "x.npz")
    if done.rc != 0:
        return desk.refused(done, "order", "sole|floor")
    motion = read_npz(desk.scratch / "x.npz")
    wanted, _ = desk.imported(desk.file("m/u_ref.csv"), "--format", "unitree")
    warned = [line for line in done.said.splitlines() if re.search("breadth-first", line) and re.search("sole|floor", line)]
    expect(warned or farthest(motion["q"], wanted["q"]) <= SAME_JOINTS, "the joints of another order, without a warning")


# K2: a robot whose base is near its soles.
@case("K2a")
def base_near_the_floor(desk):
    rows, done = desk.rows(desk.file("urdf/floorbase_run.yaml"))
    if done.rc == 2:
        return desk.refused(done, "base", "height|pelvis|floor|sole")
    wanted, _ = desk.rows(desk.file("urdf/ref_run.yaml"))
    outcomes = [sorted((row["arm"], row["outcome"], row["success"]) for row in of) for of in (rows, wanted)]
    expect(rows and outcomes[0] == outcomes[1], f"{outcomes[0]} where the same robot has {outcomes[1]}")


# K3, K4: BVH as its makers write it. Each pair is one wave, written in another way.
def imported_pair(desk, name):
    return desk.imported(desk.file(f"bvh/{name}_a.bvh"), desk.file(f"bvh/{name}_b.bvh"), "--task", "wave")


def same_wave(desk, name, tolerance=SAME_JOINTS, frames=None):
    found, done = imported_pair(desk, name)
    wanted, _ = imported_pair(desk, "ref")
    expect(found["rate_hz"] == wanted["rate_hz"], f"{found['rate_hz']} Hz")
    same_motion(found, wanted, ["a_joints", "b_joints"], tolerance, frames)
    return found, done


@case("K3a")
def hands_without_length(desk):
    found, _ = imported_pair(desk, "closedhand")
    wanted, _ = imported_pair(desk, "ref")
    hands = [22, 23]  # left_hand, right_hand of the 24 joints
    for person in ("a_joints", "b_joints"):
        body = [joint for joint in range(24) if joint not in hands]
        far = farthest(found[person], wanted[person], joints=body)
        expect(far <= SAME_JOINTS, f"{person}: a joint that is no hand is {far:.3g} m off")
        far = farthest(found[person], wanted[person], joints=hands)
        expect(far < 0.1, f"{person}: a hand is {far:.3g} m off")


for identifier, naming in (("K4a", "biped"), ("K4c", "character1"), ("K4e", "vicon"), ("K4b", "rokoko"), ("K4f", "smpl")):
    case(identifier)(lambda desk, naming=naming: same_wave(desk, naming) and None)


@case("K4h")
def one_line_too_many(desk):
    _, done = same_wave(desk, "extra")
    expect(re.search("frame|line", done.said) and re.search("45|46|more|announced", done.said), "no note on the line that is too many")


@case("K4i")
def two_spellings_of_one_clock(desk):
    same_wave(desk, "time")


@case("K4j")
def one_frame_less(desk):
    done = desk.duet("import", desk.file("bvh/short_a.bvh"), desk.file("bvh/short_b.bvh"), "--task", "wave", "-o", desk.scratch / "x.npz")
    if done.rc != 0:
        return desk.refused(done, r"--\w+", "45", "44")
    found, done = same_wave(desk, "short", frames=44)
    expect(re.search("45", done.said) and re.search("44", done.said), "no note that 45 frames were cut to 44")


@case("K4l")
def positions_that_are_all_zero(desk):
    pair = [desk.file("bvh/sixzero_a.bvh"), desk.file("bvh/sixzero_b.bvh")]
    done = desk.duet("import", *pair, "--task", "wave", "-o", desk.scratch / "x.npz")
    if done.rc == 0:
        return same_wave(desk, "sixzero") and None
    desk.refused(done, "position", "zero|0")
    expect("cannot tell the up axis" not in done.err, last_line(done.err))


# K5: dialects of text.
@case("K5a")
def byte_order_marks(desk):
    same_wave(desk, "bom")
    same_robot_motion(desk, "m/u_bom.csv")
    annotated(desk, "csv/a_bom.csv")
    found, _ = desk.imported(desk.file("csv/p_bom.csv"), "--task", "handshake")  # the tables name no task
    wanted, _ = desk.imported(desk.file("csv/p_ref.csv"), "--task", "handshake")
    same_motion(found, wanted, ["a_joints", "b_joints"], SAME_JOINTS)


def annotated(desk, name):
    done = desk.duet("dataset", "retarget", desk.file("csv/pos_ref.npz"), "--no-curation", "--annotations", desk.file(name), "-o",
                     desk.scratch / pathlib.Path(name).stem)
    expect(done.rc == 0, f"{name}: rc {done.rc}: {last_line(done.err)}")


@case("K5b")
def semicolons(desk):
    out = desk.scratch / "x"
    done = desk.duet("dataset", "retarget", desk.file("csv/pos_ref.npz"), "--no-curation", "--annotations", desk.file("csv/a_semi.csv"), "-o", out)
    if done.rc != 0:
        desk.refused(done, "';'|semicolon")


@case("K5d")
def the_reader_that_fits_best_speaks(desk):
    done = desk.duet("import", desk.file("m/u_nan.csv"), "-o", desk.scratch / "x.npz")
    desk.refused(done, "line 41", "column 1|root_x|nan")
    expect("left_wrist_x" not in done.err, last_line(done.err))
    done = desk.duet("import", desk.file("m/u_semicolon.csv"), "-o", desk.scratch / "y.npz")
    if done.rc == 0:
        return same_robot_motion(desk, "m/u_semicolon.csv")
    desk.refused(done, "';'|semicolon")
    expect("left_wrist_x" not in done.err, last_line(done.err))


# K6: files that are no data.
@case("K6a")
def pointers_and_pages(desk):
    for name in ("m/lfs.npz", "m/lfs.bvh"):
        arguments = [desk.file(name)] * (2 if name.endswith("bvh") else 1)
        desk.refused(desk.duet("import", *arguments, "-o", desk.scratch / "x.npz"), "Git LFS pointer", "git lfs pull")
    _, done = network_rows(desk, "m/lfs.onnx")
    desk.refused(done, "Git LFS pointer")
    _, done = network_rows(desk, "m/html.onnx")
    desk.refused(done, "HTML")


# K7: laws of retargeting.
@case("K7a")
def one_frame_less_moves_no_joint(desk):
    python = next((one for one in (sys.executable, "/usr/bin/python3") if subprocess.run(
        [one, "-c", "import numpy"], capture_output=True, check=False).returncode == 0), None)
    if python is None:
        raise Absent("numpy absent")
    tree = desk.scratch / "tree/build/release"
    tree.mkdir(parents=True)
    (tree / "duet").symlink_to(desk.program)
    done = desk.run([python, desk.file("tools/crop_by_one.py"), desk.scratch / "tree", desk.scratch / "cropped"])
    expect(done.rc == 0, last_line(done.err))
    moved = [float(value) for value in re.findall(r"^best \S+ max (\S+) rad", done.out, re.MULTILINE)]
    expect(len(moved) == 6, f"{len(moved)} of 6 clips")
    expect(max(moved) <= 0.1, f"best: {min(moved):.3f} to {max(moved):.3f} rad, at most 0.1 wanted")


# K8: networks as the field ships them.
def network_rows(desk, name):
    """Rows of one second under a controller whose network is this file (of the cases, or a path): ten numbers in, twelve out."""
    file = name if pathlib.Path(name).is_absolute() else desk.file(name)
    stem = pathlib.Path(name).name.replace(".", "_")
    joints = "\n".join(f"  - {{name: {joint}, default: 0, kp: 100, kd: 2, action: 0.25}}" for joint in G1_LEGS)
    (desk.scratch / f"{stem}.yaml").write_text(f"""name: network
about: a file to read
licence: none
robot: g1_12dof
network: {file}
rate_hz: 50
joints:
{joints}
observation:
  o: [{{channel: base_angular_velocity}}, {{channel: projected_gravity}}, {{channel: command_velocity}}, {{channel: constant, values: [1]}}]
inputs:
  - {{parts: [{{groups: [o]}}]}}
action: {{clip: 100, around: default}}
""")
    suite = desk.scratch / f"{stem}_run.yaml"
    suite.write_text(f"schema: duet.suite/1\nname: network\nversion: 1.0.0\nengines: [mujoco]\ncontrollers: [{stem}.yaml]\n"
                     "reference: [{velocity: [0.3, 0, 0], seconds: 1}]\n")
    return desk.rows(suite)


@case("K8a")
def an_exporter_around_the_chain(desk):
    found, done = network_rows(desk, "nets/exporter_identity.pt")
    expect(done.rc == 0 and found, f"rc {done.rc}: {last_line(done.err)}")
    # plain_chain.pt has weights of its own: with those of the exporter it is the same network.
    chain = desk.scratch / "chain.pt"
    with zipfile.ZipFile(desk.file("nets/exporter_identity.pt")) as exporter, zipfile.ZipFile(desk.file("nets/plain_chain.pt")) as plain:
        with zipfile.ZipFile(chain, "w") as made:
            for name in plain.namelist():
                made.writestr(name, (exporter if "/data/" in name else plain).read(name))
    wanted, _ = network_rows(desk, chain)
    expect([row["state_hash"] for row in found] == [row["state_hash"] for row in wanted], "the robot moves otherwise than with the chain alone")


@case("K8d")
def what_a_network_says_of_itself(desk):
    _, done = desk.rows(desk.file("nets/metadata_run.yaml"))
    expect(done.rc in (0, 2), f"rc {done.rc}: {last_line(done.err)}")
    order = [line for line in done.err.splitlines() if "joint_names" in line]
    expect(any("metadata_other" in line for line in order), "the order of joints that the network names is not said to be another")
    expect(not any("metadata_same" in line for line in order), "the right order is warned about")
    expect("joint_stiffness" in done.err, "the stiffness that the network names is not said to be another")


@case("K8e")
def a_checkpoint(desk):
    _, done = network_rows(desk, "nets/checkpoint.pt")
    desk.refused(done, "checkpoint", "export")


# K9: URDF.
def validated(desk, name, scene="state"):
    return desk.duet("validate", "--card", desk.file(f"urdf/{name}.yaml"), "--engine", "mujoco", "--scene", scene)


@case("K9a")
def a_mimic_that_is_locked(desk):
    done = validated(desk, "mimic_locked")
    expect(done.rc == 0, f"rc {done.rc}: {last_line(done.err)}")


@case("K9c")
def dynamics_that_are_dropped(desk):
    folder = desk.copied("urdf")
    (folder / "dynamics_run.yaml").write_text((folder / "ref_run.yaml").read_text().replace("ref", "dynamics"))
    found, done = desk.rows(folder / "dynamics_run.yaml")
    if re.search("damping|friction", done.err):
        return
    wanted, _ = desk.rows(folder / "ref_run.yaml")
    expect(found and [row["state_hash"] for row in found] != [row["state_hash"] for row in wanted],
           "damping and friction change nothing, and nothing is said")


@case("K9d")
def xacro_that_is_not_expanded(desk):
    desk.refused(validated(desk, "xacro"), "xacro")


@case("K9e")
def utf_16(desk):
    desk.refused(validated(desk, "utf16"), "UTF-8|UTF-16")


# K10: what a run needs is asked before its first episode.
@case("K10a")
def a_card_without_tracks(desk):
    rows, done = desk.rows(desk.file("urdf/notracks_run.yaml"))
    if done.rc == 2:
        desk.refused(done, "track")
        return expect(not rows, "an episode ran before the refusal")
    expect(rows and all(row["outcome"] != "error" for row in rows), f"rc {done.rc}: {last_line(done.err)}")


# K11: seeds of the vector environment.
SEEDS = """
import duet
S = dict(settings={"clips.synth.per_task": 3, "start": "act", "controllers": ["vmc"]}, engine="mujoco", jobs=1)
def begun(seeds):
    env = duet.make_vec_env("demo", n=len(seeds), **S)
    info = env.reset(seed=list(seeds))[1]
    env.close()
    return info
def number(value): return [int(one) for one in value]
one = duet.make_env("demo", **S)
count = duet.Batch("demo", n=1, **S).episodes
all_once = []
env = duet.make_vec_env("demo", n=3, **S)
for first in range(0, count, 3):
    all_once += number(env.reset(options={"episodes": list(range(first, first + 3))})[1]["episode"])
print({"single": [int(one.reset(seed=s)[1]["episode"]) for s in range(16)], "vector": number(begun(range(16))["episode"]),
       "halves": number(begun([0, 1])["episode"]) + number(begun([2, 3])["episode"]), "once": sorted(all_once) == list(range(count)),
       "info": sorted(begun([0, 1]))})
"""


@case("K11a")
def seeds_of_places(desk):
    if not (desk.package / "duet").is_dir():
        raise Absent(f"the package in {desk.package} absent (./run python)")
    python = os.environ.get("DUET_PYTHON", "/usr/bin/python3")
    done = desk.run([python, "-c", SEEDS], env={**os.environ, "PYTHONPATH": str(desk.package)})
    expect(done.rc == 0, last_line(done.err))
    said = ast.literal_eval(done.out.strip().splitlines()[-1])
    expect(said["vector"] == said["single"], f"16 places begin {said['vector']}, 16 single environments of these seeds {said['single']}")
    expect(said["halves"] == said["single"][:4], f"two halves begin {said['halves']}, four at once {said['single'][:4]}")
    expect(said["once"], "the episodes cannot be gone through once")
    expect({"task", "prompt", "clip", "episode"} <= set(said["info"]), f"info has {said['info']}")


def judged(name, program, package, files):
    """One of `passed`, `failed`, `not run`, and why."""
    with tempfile.TemporaryDirectory(prefix="duet-case-") as scratch:
        try:
            CASES[name](Desk(program, package, files, pathlib.Path(scratch)))
        except Wrong as wrong:
            return "failed", str(wrong)
        except Absent as absent:
            return "not run", str(absent)
        except subprocess.TimeoutExpired as late:
            return "failed", f"no end after {late.timeout:.0f} s"
    return "passed", ""


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", type=pathlib.Path, default=ROOT / "build/release/duet")
    parser.add_argument("--package", type=pathlib.Path, help="the folder that holds the package `duet`; default: python/ beside the program")
    parser.add_argument("ids", nargs="*")
    given = parser.parse_args()
    files = pathlib.Path(os.environ.get("DUET_SHARED", ROOT / "../shared")).resolve() / "cases"
    if not (files / "manifest.csv").exists():
        print(f"not run: {files} absent")
        return 0
    if not given.program.exists():
        return f"run_cases: no program {given.program}"
    manifest = [row["id"] for row in csv.DictReader((files / "manifest.csv").open(newline="", encoding="utf-8"))]
    unknown = sorted(set(manifest) ^ set(CASES)) + [one for one in given.ids if one not in manifest]
    if unknown:
        return f"run_cases: not both in the manifest and here: {', '.join(unknown)}"
    program = given.program.resolve()
    package = (given.package or given.program.parent / "python").resolve()
    counts, red = {"passed": 0, "failed": 0, "not run": 0}, 0
    for name in given.ids or manifest:
        verdict, why = judged(name, program, package, files)
        counts[verdict] += 1
        excused = name in EXPECTED_TO_FAIL
        red += verdict == "failed" and not excused
        note = {"failed": " (expected)", "passed": " (mended: take it off EXPECTED_TO_FAIL)"}.get(verdict, "") if excused else ""
        print(f"{name:5} {verdict}{note}{': ' if why else ''}{why}", flush=True)
    print(", ".join(f"{count} {verdict}" for verdict, count in counts.items()))
    return 1 if red else 0


if __name__ == "__main__":
    sys.exit(main())
