"""Disks that are full, small or read-only: the run stops, no episode fails by it, and it goes on later."""

import json
import os
import shlex
import subprocess

from common import QUICK, is_root, limit_files, lines_of, litter_of

KEEP_ALL = ["-s", "record.trajectories=all", *QUICK]


def no_errors(out):
    return all(json.loads(line)["outcome"] != "error" for line in lines_of(out))


def count(trials):
    """Episodes of the quick part."""
    return sum(row["engine"] == "playback" for row in trials.reference().values())


def small_files(trials):
    """Files that may not grow past a limit stand in for a disk that is full."""
    sizes = (4, 64) if trials.short else (1, 2, 4, 8, 16, 32, 64, 128, 256)
    for kib in sizes:
        out = trials.fresh("small-files")
        ended = trials.run(trials.command(out, *KEEP_ALL)[1:], preexec_fn=limit_files(kib))
        what = f"files of {kib} KiB"
        trials.check(f"{what}: exit code 2", ended.returncode == 2, f"rc {ended.returncode} {ended.stderr}")
        trials.check(f"{what}: one sentence", "File too large" in ended.stderr and ended.stderr.count("\n") == 1, ended.stderr)
        trials.check(f"{what}: no episode fails by it", no_errors(out))
        trials.finish(out, *KEEP_ALL)
        trials.check(f"{what}: nothing half-written is left", not litter_of(out), litter_of(out))
        trials.check(f"{what}: all episodes in the end", len(lines_of(out)) == count(trials))
    trials.say(f"file sizes limited to {', '.join(map(str, sizes))} KiB")


def small_disks(trials):
    """A tmpfs of its own, in a mount namespace of its own; enlarged, the run goes on."""
    probe = ["unshare", "-m", "sh", "-c", "mount -t tmpfs tmpfs /mnt"]
    if not is_root() or subprocess.run(probe, stderr=subprocess.DEVNULL, check=False).returncode != 0:
        return trials.say("not run: a small tmpfs (needs root)")
    folder = trials.fresh("disk")
    os.makedirs(folder)
    out = os.path.join(folder, "run")
    sizes = (16, 400) if trials.short else (4, 8, 16, 32, 64, 200, 400, 1000)
    command = " ".join(map(shlex.quote, trials.command(out, *KEEP_ALL)))
    for kib in sizes:
        script = f"""mount -t tmpfs -o size={kib}k tmpfs {folder} && {command} 2>{trials.path('said')}
echo $?; grep -c '"outcome":"error"' {out}/episodes.jsonl
mount -o remount,size=100m {folder}; {command}; echo $?; wc -l < {out}/episodes.jsonl
mount -o remount,ro {folder}; {trials.program} run {shlex.quote(shlex.split(command)[2])} -o {folder}/new -q; echo $?"""
        ended = subprocess.run(["unshare", "-m", "sh", "-c", script], capture_output=True, text=True, check=False)
        lines = [line for line in ended.stdout.split("\n") if line.strip().isdigit()]
        wanted = ["2", "0", "0", str(count(trials)), "2"]
        found = lines if len(lines) == 5 else lines[:1] + ["0"] + lines[1:]  # no row: grep has no file
        with open(trials.path("said"), encoding="utf-8") as file:
            said = file.read()
        trials.check(f"disk of {kib} KiB: stops, no errors, goes on, read-only is refused", found == wanted, f"{found} {said} {ended.stderr}")
        trials.check(f"disk of {kib} KiB: says why", "No space left on device" in said, said)
    return trials.say(f"tmpfs of {', '.join(map(str, sizes))} KiB, enlarged, then read-only")


def full_devices(trials):
    """Standard output that takes nothing is an error; standard error that takes nothing is none."""
    out = trials.fresh("device")
    with open("/dev/full", "w", encoding="utf-8") as full:
        trials.check("results to /dev/full: 2", trials.run(["list", "tasks"], stdout=full).returncode == 2)
        trials.check("messages to /dev/full: 0", trials.run(trials.command(out, *QUICK)[1:], stderr=full).returncode == 0)
        trials.check("a refusal to /dev/full: 2", trials.run(["list", "nothing"], stderr=full).returncode == 2)
    out = trials.copy("linked-device")
    os.remove(out + "/episodes.jsonl")
    os.symlink("/dev/full", out + "/episodes.jsonl")
    trials.check("rows to /dev/full: 2", trials.run(trials.command(out, *QUICK)[1:]).returncode == 2)


def folders_without_permission(trials):
    """As somebody who may not write there."""
    folder = trials.fresh("locked")
    os.makedirs(folder)
    os.chmod(folder, 0o555)
    options = {"user": 65534, "group": 65534, "extra_groups": []} if is_root() else {}
    if is_root():
        os.chmod(trials.folder, 0o755)
    ended = trials.run(trials.command(folder + "/run")[1:], **options)
    trials.check("no permission: 2", ended.returncode == 2 and "Permission denied" in ended.stderr, ended.stderr)


TRIALS = [small_files, small_disks, full_devices, folders_without_permission]
