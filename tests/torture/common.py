"""What all trials share: the program, a scratch folder, rows, and the count of what passed."""

import contextlib
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import time

SUITE = os.path.join(os.path.dirname(os.path.abspath(__file__)), "torture.yaml")
TIMES = ("started_at", "wall_s", "policy_ms")  # all that may differ between two runs of one episode
QUICK = ["--engines", "playback"]  # the part of the suite that takes no time
PERTURBATIONS = ("clean", "push", "noise", "delay")


class Counted:
    """The program under trial, a folder, and what was tried: here, and on clusters (tests/cluster)."""

    def __init__(self, program, folder, short):
        self.program = os.path.abspath(program)
        self.folder = folder
        self.short = short
        self.passed = self.failed = 0

    def check(self, what, holds, detail=""):
        self.passed += bool(holds)
        self.failed += not holds
        if not holds:
            print(f"  FAILED {what}: {detail}", flush=True)

    def say(self, text):
        print(f"  {text}", flush=True)

    def check_same_rows(self, what, wanted, out):
        """The rows of `out` are those that are wanted, each once, in every field that repeats."""
        found = rows_of(out)
        missing, more = wanted.keys() - found.keys(), found.keys() - wanted.keys()
        self.check(f"{what}: the same episodes", not missing and not more, f"{len(missing)} missing, {len(more)} more")
        lines = len(lines_of(out))
        self.check(f"{what}: each once", lines == len(found), f"{lines} lines, {len(found)} episodes")
        different = [key for key in wanted.keys() & found.keys() if lasting(wanted[key]) != lasting(found[key])]
        self.check(f"{what}: equal rows", not different, f"{len(different)} differ, the first: {different[:1]}")

    def try_each(self, trials, only=None, name=lambda trial: trial.__name__, skip=lambda trial: None):
        """Those whose name contains `only`; `skip` gives the reason why one is left out."""
        for trial in trials:
            if only and only not in name(trial):
                continue
            if skip(trial):
                print(f"{name(trial)}: SKIPPED ({skip(trial)})", flush=True)
                continue
            print(f"{name(trial)}: {trial.__doc__}", flush=True)
            begin = time.monotonic()
            trial(self)
            print(f"  {time.monotonic() - begin:.1f} s", flush=True)


class Trials(Counted):
    """Of one process on one machine."""

    def __init__(self, program, folder, short, seed):
        super().__init__(program, folder, short)
        self.seed = seed
        self.engines = "playback"
        if self.run(["doctor", "--need", "mujoco"]).returncode == 0:
            self.engines = "playback, mujoco"

    def path(self, *names):
        return os.path.join(self.folder, *names)

    def fresh(self, name):
        """The path of a folder that is not there yet."""
        path = self.path(name)
        shutil.rmtree(path, ignore_errors=True)
        return path

    def command(self, out, *more):
        size = ["-s", f"engines=[{self.engines}]", "-s", f"clips.synth.per_task={1 if self.short else 2}"]
        return [self.program, "run", SUITE, *size, "-o", out, "-q", *more]

    def start(self, command, **options):
        """A process with a group of its own, so that it can be killed with all that it started."""
        options.setdefault("stdout", subprocess.DEVNULL)
        options.setdefault("stderr", subprocess.PIPE)
        return subprocess.Popen(command, start_new_session=True, text=True, errors="replace", **options)

    def run(self, arguments, timeout=300, **options):
        options.setdefault("stdout", subprocess.PIPE)
        options.setdefault("stderr", subprocess.PIPE)
        return subprocess.run([self.program, *arguments], timeout=timeout, text=True, errors="replace", **options)

    def finish(self, out, *more):
        """Runs the suite to its end; the seconds that took."""
        begin = time.monotonic()
        ended = self.run(self.command(out, *more)[1:])
        self.check("a run without disturbance ends well", ended.returncode == 0, f"rc {ended.returncode} {ended.stderr}")
        return time.monotonic() - begin

    def reference(self):
        """Rows by key of a run that nobody disturbed; made once."""
        out = self.path("reference")
        if not os.path.exists(out):
            self.seconds = self.finish(out)
        return rows_of(out)

    def copy(self, name):
        """A folder of that name with the run that nobody disturbed."""
        self.reference()
        return shutil.copytree(self.path("reference"), self.fresh(name))

    def check_rows(self, what, out, engines=("playback", "mujoco")):
        """The rows of `out` are those of the reference in these engines, each once, in every field that repeats."""
        wanted = {key: row for key, row in self.reference().items() if row["engine"] in engines}
        self.check_same_rows(what, wanted, out)


def lasting(row):
    return {name: value for name, value in row.items() if name not in TIMES}


def lines_of(out):
    """Whole lines; what a killed process left of one is not among them."""
    with contextlib.suppress(FileNotFoundError):
        with open(os.path.join(out, "episodes.jsonl"), "rb") as file:
            return file.read().split(b"\n")[:-1]
    return []


def rows_of(out):
    return {row["key"]: row for row in map(json.loads, lines_of(out))}


def litter_of(out):
    return [name for _, _, names in os.walk(out) for name in names if ".part-" in name]


def kill(process, number=signal.SIGKILL):
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, number)
    process.communicate()
    return process.returncode


def limit_files(kib):
    """For preexec_fn: no file grows past so many KiB."""
    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (kib * 1024, kib * 1024))
        signal.signal(signal.SIGXFSZ, signal.SIG_DFL)  # Python ignores it, and a child would inherit that
    return limit


def is_root():
    return os.geteuid() == 0


def exit_with(trials):
    print(f"{trials.passed} passed, {trials.failed} failed")
    sys.exit(1 if trials.failed else 0)
