"""Folders that came from somebody else: links that lead out, files that are nested without end."""

import os

from common import QUICK

FILES = ("run.json", "env.json", "suite.yaml", "episodes.jsonl", "resumed.jsonl", "lock", "leaderboard.md", "report.html",
         "results.sqlite", "leaderboard.csv", "leaderboard.json", "leaderboard.tex")
COMMANDS = (["report", "{run}", "-q", "--no-clips", "-f", "md,html,sqlite,csv,json,tex"],)


def hostile_links(trials):
    """Nothing outside the folder changes, whatever in it is a link."""
    target, away = trials.path("bashrc"), trials.path("away")
    for name in FILES:
        for dangling in (False, True):
            run = trials.copy("hostile")
            for path in (target, target + ".new"):
                if os.path.exists(path):
                    os.remove(path)
            with open(target, "w", encoding="utf-8") as file:
                file.write("mine\n")
            if os.path.lexists(os.path.join(run, name)):
                os.remove(os.path.join(run, name))
            os.symlink(target + ".new" if dangling else target, os.path.join(run, name))
            for command in (*COMMANDS, trials.command(run, *QUICK)[1:]):
                trials.run([word.format(run=run) for word in command])
            with open(target, encoding="utf-8") as file:
                untouched = file.read() == "mine\n"
            trials.check(f"{name} is a link: its target stays", untouched and not os.path.exists(target + ".new"))
    for name in ("trajectories", "prepared"):
        run = trials.copy("hostile")
        os.makedirs(away, exist_ok=True)
        os.symlink(away, os.path.join(run, name))
        os.truncate(os.path.join(run, "episodes.jsonl"), 0)
        ended = trials.run(trials.command(run, *QUICK)[1:])
        trials.check(f"{name} is a link: refused", ended.returncode == 2 and "symbolic link" in ended.stderr, ended.stderr)
        trials.check(f"{name} is a link: nothing is written there", not os.listdir(away))
    trials.say(f"{2 * len(FILES) + 2} links that lead out of a run folder")


def deep_inputs(trials):
    """Nesting that would overflow a stack is refused with a sentence."""
    deep = "[" * 200000 + "]" * 200000
    cases = {"episodes.jsonl": f'{{"schema": {deep}}}\n', "run.json": f'{{"schema": "duet.run/1", "suite": {deep}}}',
             "env.json": f'{{"extra": {deep}}}'}
    for name, text in cases.items():
        run = trials.copy("deep")
        with open(os.path.join(run, name), "w", encoding="utf-8") as file:
            file.write(text)
        ended = trials.run(["report", run, "-q", "--no-clips", "-f", "md,html"])
        trials.check(f"{name} nested 200,000 deep: 2", ended.returncode == 2, f"rc {ended.returncode} {ended.stderr[:200]}")
    trials.say(f"{len(cases)} files nested 200,000 deep")


TRIALS = [hostile_links, deep_inputs]
