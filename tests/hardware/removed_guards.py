#!/usr/bin/env python3
"""Takes each clamp, timeout and refusal of the real robot's safety envelope away, one at a time: some test has to fail.

  ./run guards [--only TEXT] [--list] [--turn N] [--seconds S] [--build FOLDER]     (builds first)

The product has no switch for this. The sources that hold guards are copied into BUILD/removed_guards, with a question in
front of each guard ("is this the one that is missing now?"), compiled once with their build's own command, and linked in
front of the room's library into one more test program. The program then runs once for each guard, which the environment
names, with the suites that are about it; a failed test, a crash or a run out of time has missed the guard. First the same
program has to pass with nothing missing. The table of guards is tests/hardware/guard_table.py; it fails where a guard's
text is not in its file exactly as often as it says, and where a reason of a clamp, a cause of a stop, a limit or an age
has no entry. Exit code 1: a guard that nobody missed.

--turn N asks about one source of the table, another with each N, and begins at another of its guards each time round;
--seconds S asks no further guard after S seconds, and says how many are left. Together they are the short form.
"""
import argparse
import concurrent.futures
import os
import pathlib
import re
import shutil
import subprocess
import sys
import time
import zlib

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / 'tests'), str(ROOT / 'tests/hardware')]
os.chdir(ROOT)

import guard_table  # noqa: E402
from mutants_build import OUTPUT, Build  # noqa: E402

QUESTION = '''#include <cstdlib>
namespace {
[[maybe_unused]] bool duet_removed(unsigned long guard) {
  static const char* const text = std::getenv("DUET_REMOVED_GUARD");
  static const unsigned long removed = text == nullptr ? 0 : std::strtoul(text, nullptr, 10);
  return guard == removed;
}
}  // namespace
'''
SECONDS = 120  # of a run
SECOND = 'a second lock'
LAUNCHER = 'ccache ' if shutil.which('ccache') else ''


def number_of(guard):
    """By its name alone, so that what is compiled stays as it is when the table grows elsewhere."""
    return zlib.crc32(guard.name.encode())


def with_questions(path, guards):
    """The file's text in which every guard asks whether it is there."""
    text = pathlib.Path(path).read_text()
    for guard in guards:
        if text.count(guard.old) != 1:
            sys.exit(f'guard table: {path}: expected "{guard.old}" once, found it {text.count(guard.old)} times')
        text = text.replace(guard.old, guard.new.replace('REMOVED', f'duet_removed({number_of(guard)})'))
    return QUESTION + text


def build_program(build, asked, folder):
    """The test program with the questions of these guards; its path."""
    folder.mkdir(exist_ok=True)
    by_file = {}
    for guard in asked:
        by_file.setdefault(guard.path, []).append(guard)

    def compiled(path):
        source = folder / pathlib.Path(path).name
        source.write_text(with_questions(path, by_file[path]))
        words = build.compile[path].split()
        command = OUTPUT.sub(f'{source}.o', ' '.join(words)).rsplit(' -c ', 1)[0]
        done = subprocess.run(f'{LAUNCHER}{command} -w -iquote {os.path.abspath(os.path.dirname(path))} -c {source}', shell=True,
                              cwd=build.folder, capture_output=True, text=True)
        if done.returncode:
            sys.exit(f'{path} does not compile with its questions:\n{done.stderr}')
        return f'{source}.o'

    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        objects = list(pool.map(compiled, by_file))
    program = folder / 'hardware_test'
    command = OUTPUT.sub(str(program), build.links['tests/hardware/hardware_test'])
    library = 'hardware/libduet_hardware.a'
    command = command.replace(f' {library} ', f' {" ".join(objects)} {library} ', 1) + ' -Wl,--allow-multiple-definition'
    done = subprocess.run(command, shell=True, cwd=build.folder, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f'the test program could not be linked: {done.stderr}')
    return program


def who_missed(program, number, suites):
    """The first test that failed; empty where all passed."""
    environment = dict(os.environ, DUET_REMOVED_GUARD=str(number))
    try:
        done = subprocess.run([program, '--gtest_fail_fast', '--gtest_color=no', f'--gtest_filter={suites}'],
                              env=environment, capture_output=True, text=True, errors='replace', timeout=SECONDS)
    except subprocess.TimeoutExpired:
        return 'a run out of time'
    if done.returncode == 0:
        if 'PASSED  ] 0 tests' in done.stdout:
            sys.exit(f'guard table: no test has a name of {suites}')
        return ''
    failed = re.findall(r'^\[  FAILED  \] (\S+?),? ', done.stdout, re.M)
    running = re.findall(r'^\[ RUN      \] (\S+)', done.stdout, re.M)
    return failed[0] if failed else f'{running[-1] if running else "the start"} (crash)'


def drawn(arguments, guards):
    """The guards to ask about."""
    asked = [guard for guard in guards if arguments.only in guard.name]
    if arguments.turn is None:
        return asked
    paths = sorted({guard.path for guard in asked})
    path = paths[arguments.turn % len(paths)]
    asked = [guard for guard in asked if guard.path == path]
    first = 7 * (arguments.turn // len(paths)) % len(asked)
    return asked[first:] + asked[:first]


def parsed():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--build', default='build/release', metavar='FOLDER')
    parser.add_argument('--only', default='', metavar='TEXT', help='guards whose name holds this')
    parser.add_argument('--list', action='store_true', help='print the table and try nothing')
    parser.add_argument('--turn', type=int, metavar='N', help='one source of the table, by this number')
    parser.add_argument('--seconds', type=float, default=float('inf'), metavar='S', help='after which no further is asked')
    return parser.parse_args()


def main():
    arguments = parsed()
    end = time.monotonic() + arguments.seconds
    guards = guard_table.guards()
    guard_table.check_complete(guards)
    asked = drawn(arguments, guards)
    if arguments.list or not asked:
        print('\n'.join(f'{guard.name}  {guard.path}' for guard in asked) or 'no guard has such a name')
        return 0
    build = Build(arguments.build)
    program = build_program(build, asked, pathlib.Path(build.folder) / 'removed_guards')
    suites = sorted({suite for guard in asked for suite in guard.suites.split(':')})
    if missed := who_missed(program, 0, ':'.join(suites)):
        sys.exit(f'{missed} fails with every guard in its place')

    def ask(guard):
        if time.monotonic() > end:
            return None
        missed = who_missed(program, number_of(guard), guard.suites)
        reason = guard_table.SECOND_LOCKS.get(guard.name)
        nobody = f'a second lock: {reason}' if reason else f'NOBODY MISSED IT ({guard.path})'
        print(f'{guard.name}: {"missed by " + missed if missed else nobody}', flush=True)
        missed = missed or (SECOND if reason else '')
        return missed

    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        answers = [missed for missed in pool.map(ask, asked) if missed is not None]
    survivors, second, left = answers.count(''), answers.count(SECOND), len(asked) - len(answers)
    print(f'{len(answers)} guards taken away one at a time, {len(answers) - survivors - second} missed, {second} second '
          f'locks, {survivors} not' +
          (f'; {left} left for want of time' if left else ''))
    return 1 if survivors else 0


if __name__ == '__main__':
    sys.exit(main())
