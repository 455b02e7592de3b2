"""Two and four processes in one folder."""

import random
import time

from common import PERTURBATIONS, kill, lines_of


def together(trials, out, commands):
    """Starts all, waits for all; their exit codes and what they said."""
    processes = []
    for command, delay in commands:
        time.sleep(delay)
        processes.append(trials.start(command))
    said = [process.communicate(timeout=300)[1] for process in processes]
    return [process.returncode for process in processes], said


def same_episodes(trials):
    """Processes that are asked for the same share it."""
    chance = random.Random(trials.seed)
    rounds = 0
    for count in (2, 4):
        for _ in range(1 if trials.short else 4):
            out = trials.fresh("shared")
            commands = [(trials.command(out, "-j", "1"), chance.uniform(0.0, 0.5)) for _ in range(count)]
            codes, said = together(trials, out, commands)
            trials.check(f"{count} processes end well", codes == [0] * count, f"{codes} {said}")
            trials.check_rows(f"{count} processes", out)
            rounds += 1
    trials.say(f"the same suite in 2 and 4 processes on one folder: {rounds} times")


def parts(trials):
    """Each its own perturbation: playback, which is clean in each, is shared."""
    rounds = 1 if trials.short else 4
    for _ in range(rounds):
        out = trials.fresh("parts")
        commands = [(trials.command(out, "-j", "1", "--perturbations", name), 0.0) for name in PERTURBATIONS]
        codes, said = together(trials, out, commands)
        trials.check("four parts end well", codes == [0] * 4, f"{codes} {said}")
        trials.check_rows("four parts", out)
        report = trials.run(["report", out, "-q", "--no-clips", "-o", trials.fresh("parts-report")])
        trials.check("four parts are a whole run", report.returncode == 0 and "partial" not in report.stdout, report.stdout[:300])
    trials.say(f"four parts of the suite at once on one folder: {rounds} times")


def one_is_killed(trials):
    """What a killed process was at is done by the other."""
    chance = random.Random(trials.seed + 2)
    rounds = 2 if trials.short else 8
    for _ in range(rounds):
        out = trials.fresh("widow")
        first = trials.start(trials.command(out, "-j", "1"))
        second = trials.start(trials.command(out, "-j", "1"))
        time.sleep(chance.uniform(0.2, 0.2 + trials.seconds))
        before = lines_of(out)
        kill(first)
        said = second.communicate(timeout=300)[1]
        trials.check("the other process ends well", second.returncode == 0, f"{second.returncode} {said}")
        trials.check("it keeps the rows of the killed one", lines_of(out)[: len(before)] == before)
        trials.check_rows("one of two is killed", out)
    trials.say(f"one of two processes killed: {rounds} times")


def destroyed_before(trials):
    """A folder in which every row stands twice, as two programs of old left it."""
    out = trials.copy("twice")
    path = out + "/episodes.jsonl"
    with open(path, "rb") as file:
        text = file.read()
    with open(path, "ab") as file:
        file.write(text)
    report = trials.run(["report", out, "-q", "--no-clips", "-o", trials.fresh("twice-report")])
    trials.check("equal rows count once, with a warning", report.returncode == 0 and "twice" in report.stderr, report.stderr)
    trials.check("such a folder can be resumed", trials.run(trials.command(out)[1:]).returncode == 0)
    with open(path, "ab") as file:
        file.write(text.replace(b'"outcome":"ok"', b'"outcome":"fell"', 1))
    report = trials.run(["report", out, "-q", "--no-clips"])
    trials.check("rows that differ are refused with the field", report.returncode == 2 and "outcome" in report.stderr, report.stderr)


TRIALS = [same_episodes, parts, one_is_killed, destroyed_before]
