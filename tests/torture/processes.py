"""Signals, closed streams, time limits: exit codes, and that the run goes on."""

import contextlib
import os
import random
import signal
import subprocess
import time

from common import QUICK, limit_files, rows_of

LONG = ["-s", "clips.synth.per_task=300", "-j", "1"]  # minutes of preparation


def signals(trials):
    """Heard within a second while clips are prepared and while episodes are run."""
    wanted = {signal.SIGHUP: 75, signal.SIGTERM: 75, signal.SIGINT: 130}
    slowest = 0.0
    for more, phase in ((LONG, "prepares"), (["-s", "episodes_per_clip=10000", "-j", "2"], "rolls out")):
        for number, code in wanted.items():
            out = trials.fresh("signal")
            process = trials.start(trials.command(out, *more))
            time.sleep(1.5)
            begin = time.monotonic()
            os.kill(process.pid, number)
            said = process.communicate(timeout=60)[1]
            slowest = max(slowest, time.monotonic() - begin)
            trials.check(f"{number.name} while it {phase}: {code}", process.returncode == code, f"{process.returncode} {said}")
    trials.say(f"SIGHUP, SIGTERM and SIGINT while clips are prepared and episodes are run; the slowest end took {slowest:.1f} s")


def second_signal(trials):
    """A second Ctrl-C ends the program at once, and nothing is lost."""
    out = trials.fresh("twice-interrupted")
    process = trials.start(trials.command(out, *LONG))
    time.sleep(0.5)
    os.kill(process.pid, signal.SIGINT)
    os.kill(process.pid, signal.SIGINT)
    process.communicate(timeout=60)
    trials.check("two times Ctrl-C", process.returncode in (130, -signal.SIGINT), process.returncode)


def nohup(trials):
    """Under nohup a lost connection changes nothing."""
    out = trials.fresh("nohup")
    process = trials.start(trials.command(out, *QUICK), preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN))
    time.sleep(0.3)
    os.kill(process.pid, signal.SIGHUP)
    said = process.communicate(timeout=300)[1]
    trials.check("SIGHUP under nohup: 0", process.returncode == 0, f"{process.returncode} {said}")
    trials.check_rows("under nohup", out, engines=("playback",))


def file_size_signal(trials):
    """SIGXFSZ does not end the program."""
    ended = trials.run(trials.command(trials.fresh("xfsz"), *QUICK)[1:], preexec_fn=limit_files(8))
    trials.check("SIGXFSZ: 2 and a sentence", ended.returncode == 2 and "File too large" in ended.stderr, f"{ended.returncode} {ended.stderr}")


def closed_streams(trials):
    """Closed standard streams are no error, and no file is opened in their place."""
    for closed in ((2,), (1,), (0,), (0, 1, 2)):
        out = trials.fresh("closed")
        redirect = " ".join(f"{number}{'<' if number == 0 else '>'}&-" for number in closed)
        script = " ".join(f"'{word}'" for word in trials.command(out, *QUICK)) + " " + redirect
        code = subprocess.run(["sh", "-c", script], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False).returncode
        trials.check(f"streams {closed} closed: 0", code == 0, code)
        trials.check_rows(f"streams {closed} closed", out, engines=("playback",))
    code = subprocess.run(["sh", "-c", f"'{trials.program}' list nothing 2>&- >&-"], check=False).returncode
    trials.check("a refusal with closed streams: 2", code == 2, code)


def time_limits(trials):
    """The limit counts from the start of the command and is heard in every phase."""
    for limit, more in ((0.01, []), (0.3, LONG), (1.0, ["-s", "episodes_per_clip=60000"]), (1.0, ["-s", "dt=0.000001", "-j", "1"])):
        out = trials.fresh("limited")
        begin = time.monotonic()
        ended = trials.run(trials.command(out, "--time-limit", str(limit), *more)[1:], timeout=60)
        took = time.monotonic() - begin
        trials.check(f"time limit {limit} s {more}: 75", ended.returncode == 75, f"{ended.returncode} {ended.stderr}")
        trials.say(f"--time-limit {limit} {' '.join(more)}: ended after {took:.1f} s")
    ended = trials.run(trials.command(trials.fresh("huge"), "-s", "episodes_per_clip=2000000000")[1:], timeout=60)
    trials.check("a plan without measure: 2 and its count", ended.returncode == 2 and "at most 10000000 episodes" in ended.stderr, ended.stderr)


def stopped(trials):
    """Stopped for three times an episode's limit, `run` and workers make the rows that they would have made."""
    limit = ["-s", "limits.wall_s_per_episode=1"]
    wanted_at = trials.fresh("unstopped")
    seconds = trials.finish(wanted_at, *limit)
    wanted = rows_of(wanted_at)
    generator, count = random.Random(trials.seed), 4 if trials.short else 20
    for number in range(count):
        out = trials.fresh("stopped")
        works = number % 2 == 1
        if works:
            planned = trials.run(["plan", *trials.command(out, *limit)[2:], "--shards", "2"])  # one of each engine
            trials.check("a plan: 0", planned.returncode == 0, planned.stderr)
        shards = [[trials.program, "work", out, "--shard", shard, "-q"] for shard in "1010"]
        processes = [trials.start(command) for command in (shards if works else [trials.command(out, *limit)])]
        time.sleep(generator.uniform(0.05, 0.8) * seconds)
        stop_for(processes[0], 3.0)
        for process in processes:
            said = process.communicate(timeout=600)[1]
            trials.check("a process that was stopped: 0", process.returncode == 0, f"{process.returncode} {said}")
        if works:
            merged = trials.run(["merge", out])
            trials.check("a merge after a stop: 0", merged.returncode == 0, merged.stdout + merged.stderr)
        trials.check_same_rows("workers, one stopped" if works else "a stopped run", wanted, out)
    trials.say(f"{count} stops of 3 s, the limit being 1 s: {count // 2} of a run, {count // 2} of one of two workers of each shard")


def stop_for(process, seconds):
    """Stops a process that may have ended already, and lets it go on."""
    for number in (signal.SIGSTOP, signal.SIGCONT):
        with contextlib.suppress(ProcessLookupError):
            os.kill(process.pid, number)
        if number == signal.SIGSTOP:
            time.sleep(seconds)


def endless_input(trials):
    """A text without end is refused by name."""
    for arguments in (["run", "/dev/zero", "--dry-run"], ["check", trials.path("reference"), "-b", "/dev/zero"]):
        trials.reference()
        ended = trials.run(arguments, timeout=60)
        trials.check(f"{arguments[0]} /dev/zero: 2", ended.returncode == 2 and "/dev/zero" in ended.stderr, ended.stderr)


TRIALS = [signals, second_signal, nohup, file_size_signal, closed_streams, time_limits, stopped, endless_input]
