#!/usr/bin/env python3
"""Changes one operator of the product at a time and asks whether a test notices.

  ./run mutants [SEED] [COUNT] [ROOM...]     (builds first; SEED 1, COUNT 40, all rooms)

A changed file is compiled with the command of its build and linked in front of the room's library, in folders of its own
within the build (a program finds the tree's files only from there); all else of tree and build is only read. Then the tests of its room run, quick suites first, and
among them those that include the file's header. A test that fails, a crash and a run out of its time limit have noticed
the change.

The file is compiled alone at first: its definitions win over those of the library. Where it has variables of its own,
which such a program has twice, the test that noticed must pass with the unchanged file linked likewise. What the room's
tests let pass, and what does not compile alone, is compiled with the files that its build compiles together with it (a
minute), and the tests of every room that links it run too: a changed engine, library or command reaches them through
DUET_ENGINES and DUET_PROGRAM. Only then it has survived.

What is not drawn: headers; lines of `for (`, `require(`, `throw` and `fmt::` (loops that run out of an array and words of
messages); benchmarks and the engines' bare loops (what they give is time); code for libtorch and the command that
runs it. A change that gives the same machine code, or that stands in tests/mutants_equivalent.txt with its reason, is counted apart.

The draw depends on the seed and on the lines alone, so that a commit elsewhere leaves it as it is. A second call with the
same seed goes on where the first ended; it asks again only what survived, and gives both shares. Report:
build/mutants/SEED.txt; the verdicts: build/mutants/SEED.tsv, which goes on on another machine as tests/mutants_asked/SEED.tsv.
"""
import argparse
import collections
import concurrent.futures
import json
import os
import pathlib
import re
import resource
import shutil
import signal
import subprocess
import sys
import threading
import time

from mutants_build import EQUIVALENT, ROOMS, SKIPPED_FILES, Build, Compiled, OUTPUT, equivalents, mutants_of

ASKED = 'tests/mutants_asked'
ASKED_VERDICTS = ('noticed', 'unnoticed', 'SURVIVED')
QUICK = 1000  # milliseconds of a test suite
MEMORY = 12 << 30


def limited(cpu_seconds):
    def set_limits():
        os.setsid()
        resource.setrlimit(resource.RLIMIT_CPU, (cpu_seconds, cpu_seconds + 5))
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    return set_limits


def run_tests(program, filters, environment, cpu_seconds, log):
    """Who noticed, '' where all pass, and the processor seconds that took; limited is that time, not the clock's."""
    arguments = [program, '--gtest_fail_fast', '--gtest_color=no'] + ([f'--gtest_filter={filters}'] if filters else [])
    with open(log, 'w') as out:
        tests = subprocess.Popen(arguments, env=environment, stdout=out, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL,
                                 preexec_fn=limited(cpu_seconds))
        code, seconds = ended(tests, 8 * cpu_seconds)
    return (who_noticed(code, pathlib.Path(log).read_text(errors='replace')) if code else ''), seconds


def ended(tests, clock_seconds):
    """Exit code (negative: a signal) and processor seconds; everything that the tests started is ended with them."""
    timer = threading.Timer(clock_seconds, lambda: os.killpg(tests.pid, signal.SIGKILL))
    timer.start()
    try:
        _, status, usage = os.wait4(tests.pid, 0)
    finally:
        timer.cancel()
        try:
            os.killpg(tests.pid, signal.SIGKILL)
        except ProcessLookupError:
            pass
    tests.returncode = os.waitstatus_to_exitcode(status)
    return tests.returncode, usage.ru_utime + usage.ru_stime


def who_noticed(code, text):
    failed = re.findall(r'^\[  FAILED  \] (\S+?),?(?: |$)', text, re.M)
    last = re.findall(r'^\[ RUN      \] (\S+)', text, re.M)
    name = failed[0] if failed else last[-1] if last else 'before the first test'
    if code in (-signal.SIGXCPU, -signal.SIGKILL):
        return f'{name} (time limit)'
    if code < 0:
        return f'{name} (ended by signal {-code})'
    return name if failed else f'{name} (exit {code})'


def suite_times(log):
    """{suite: milliseconds} of a program's output."""
    return {name: int(ms) for name, ms in re.findall(r'^\[-+\] \d+ tests? from (\S+) .*\((\d+) ms total\)$', log, re.M)}


class Trials:
    def __init__(self, build, scratch, quick):
        self.build, self.scratch, self.quick, self.lock = build, scratch, quick, threading.Lock()

    def folder(self, worker):
        """Where a worker compiles and links, empty: in the build, where its programs find the files of the tree. Engines that
        an earlier call left there would be taken for those of this build."""
        folder = pathlib.Path(self.build.folder) / 'mutants' / f'worker{worker}'
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        return folder

    def baseline(self, room):
        """Processor seconds of the tests of a room, which have to pass unchanged, and {suite: milliseconds}."""
        file = self.scratch / 'baseline.json'
        program = f'{self.build.folder}/{self.build.programs[room]}'
        stamp = os.stat(program).st_mtime
        with self.lock:
            known = json.loads(file.read_text()) if file.exists() else {}
            if known.get(room, [0])[0] != stamp:
                log = self.scratch / f'baseline-{room}.log'
                noticed, seconds = run_tests(program, '', dict(os.environ), 600, log)
                if noticed:
                    raise SystemExit(f'{room}_test does not pass unchanged: {noticed} ({log})')
                known[room] = [stamp, seconds, suite_times(log.read_text(errors='replace'))]
                file.write_text(json.dumps(known))
        return known[room][1:]

    def cpu_seconds(self, room):
        """The limit for the tests of a room: five times what they take unchanged."""
        return int(20 + 5 * self.baseline(room)[0])

    def filters(self, path, room):
        """One for each run of a room's tests: quick suites before slow ones, each time those about the file first."""
        about = self.build.suites_about(path, room)
        groups = {}
        for suite, ms in self.baseline(room)[1].items():
            groups.setdefault((ms >= QUICK, suite.split('/')[-1] not in about and suite not in about), []).append(suite)
        return [':'.join(f'{suite}.*' for suite in groups[key]) for key in sorted(groups)]

    def compile(self, folder, path, text, united=False):
        """The text in place of the file; None where it does not compile."""
        source = folder / pathlib.Path(path).name
        source.write_text(text)
        if united:
            others = pathlib.Path(self.build.unit[path]).read_text()
            (folder / 'unity.cpp').write_text(others.replace(f'"{os.path.abspath(path)}"', f'"{source}"'))
            source = folder / 'unity.cpp'
        output = folder / (source.name + '.o')
        words = self.build.compile[path].split()
        while '=' in words[0] or words[0].endswith(('/cmake', '/ccache')) or words[0] in ('-E', 'env'):
            words.pop(0)  # the launcher: what is compiled here once is of no use in the cache
        command = OUTPUT.sub(str(output), ' '.join(words)).rsplit(' -c ', 1)[0]
        quote = os.path.abspath(os.path.dirname(path))
        done = subprocess.run(f'{command} -w -iquote {quote} -c {source}', shell=True, cwd=self.build.folder,
                              capture_output=True)
        return Compiled(path, output, united) if done.returncode == 0 else None

    def unchanged(self, folder, path):
        (folder / 'unchanged').mkdir(exist_ok=True)
        return self.compile(folder / 'unchanged', path, pathlib.Path(path).read_text())

    def environment(self, folder, changed, room):
        """Engines and program with the change in them, where this room's tests use them."""
        environment = dict(os.environ, TMPDIR=str(folder / 'tmp'))
        shutil.rmtree(folder / 'tmp', ignore_errors=True)
        (folder / 'tmp').mkdir()
        uses_engines = 'libduet_backends.a' in self.build.links[self.build.programs[room]]
        if uses_engines and any(self.build.holds(engine, changed.path) for engine in self.build.engines):
            shutil.rmtree(folder / 'engines', ignore_errors=True)
            (folder / 'engines').mkdir()
            for engine in self.build.engines:
                if self.build.holds(engine, changed.path):
                    self.build.link(engine, changed, str(folder / engine))
                else:
                    (folder / engine).symlink_to(f'{self.build.folder}/{engine}')
            environment['DUET_ENGINES'] = str(folder / 'engines')
        if room == 'app' and self.build.holds('duet', changed.path):
            self.build.link('duet', changed, str(folder / 'duet'))
            environment['DUET_PROGRAM'] = str(folder / 'duet')
        return environment

    def noticed_by_room(self, folder, changed, room, filters):
        environment = self.environment(folder, changed, room)
        program = f'{self.build.folder}/{self.build.programs[room]}'
        if self.build.holds(self.build.programs[room], changed.path):
            program = str(folder / f'{room}_test')
            self.build.link(self.build.programs[room], changed, program)
        for tests in filters:
            if noticed := run_tests(program, tests, environment, self.cpu_seconds(room), folder / 'log')[0]:
                return noticed
        return ''

    def rooms_for(self, path):
        """The file's room first where it has tests, then each whose tests link it, hold it in an engine or in the program."""
        own = path.split('/')[0]
        held_by_engine = any(self.build.holds(engine, path) for engine in self.build.engines)
        above = [room for room, program in self.build.programs.items() if room != own and (
            self.build.holds(program, path) or
            (held_by_engine and 'libduet_backends.a' in self.build.links[program]))]
        return [own] * (own in self.build.programs) + above

    def noticed(self, folder, changed, rooms):
        """Which test of these rooms notices first, '' where none does."""
        for room in rooms:
            if noticed := self.noticed_by_room(folder, changed, room, self.filters(changed.path, room)):
                return '' if self.is_of_the_recipe(folder, changed, room, noticed) else f'{room}: {noticed}'
        return ''

    def is_of_the_recipe(self, folder, changed, room, noticed):
        """Whether the unchanged file, compiled alone, fails that test too: its variables are there twice."""
        if changed.united or not changed.has_variables():
            return False
        test = noticed.split(' ')[0]
        unchanged = self.unchanged(folder, changed.path)
        return self.noticed_by_room(folder / 'unchanged', unchanged, room, [test if '.' in test else '-*']) != ''

    def verdict(self, mutant, folder):
        lines = pathlib.Path(mutant.path).read_text().split('\n')
        lines[mutant.number - 1] = mutant.line
        text, rooms = '\n'.join(lines), self.rooms_for(mutant.path)
        alone = self.compile(folder, mutant.path, text)
        if alone and (noticed := self.noticed(folder, alone, rooms[:1])):
            return 'noticed', noticed
        unchanged = self.unchanged(folder, mutant.path)
        if unchanged and not alone:
            return 'nocompile', ''
        if alone and unchanged.object.read_bytes() == alone.object.read_bytes():
            return 'same', 'the machine code is the same'
        if self.quick:
            return 'unnoticed', ''
        if alone and (noticed := self.noticed(folder, alone, rooms[1:])):
            return 'noticed', noticed
        if mutant.path not in self.build.unit:
            return 'SURVIVED', ''
        united = self.compile(folder, mutant.path, text, united=True)
        if not united:
            return 'nocompile', ''
        noticed = self.noticed(folder, united, rooms)
        return ('noticed', noticed) if noticed else ('SURVIVED', '')

    def control(self, path, folder):
        """The recipe with nothing changed: says whether a test complains all the same."""
        unchanged = self.compile(folder, path, pathlib.Path(path).read_text())
        noticed = unchanged and self.noticed(folder, unchanged, self.rooms_for(path)[:1])
        return f'control: {path} is unchanged, yet {noticed}' if noticed else ''


class Report:
    """Verdicts by key, kept from call to call in SEED.tsv (key, verdict at first, verdict now, by); SEED.txt is for people."""

    def __init__(self, scratch, seed, settled):
        self.file, self.settled = scratch / f'{seed}.tsv', settled
        self.known, self.lines, self.met = {}, [], []
        for file in (pathlib.Path(ASKED) / f'{seed}.tsv', self.file):
            for line in file.read_text().splitlines() if file.exists() else []:
                key, first, now, by = line.split('\t')
                self.known[key] = first, now, by

    def add(self, mutant, verdict, by):
        first = self.known.get(mutant.key, ['unnoticed'])[0]
        first = verdict if first == 'unnoticed' else first
        if verdict != 'equivalent' or first != verdict:
            self.known[mutant.key] = first, verdict, by
        self.met.append((first, verdict))
        self.say(f'{verdict:10} {mutant}' + (f'  [{by}]' if by else ''))
        self.file.write_text(''.join('\t'.join((key, *known)) + '\n' for key, known in sorted(self.known.items())))

    def say(self, line):
        self.lines.append(line)
        print(line, flush=True)
        self.file.with_suffix('.txt').write_text('\n'.join(self.lines) + '\n')

    def earlier(self, mutant):
        _, verdict, by = self.known.get(mutant.key, ['', '', ''])
        return (verdict, by) if verdict in self.settled else None

    def asked(self):
        """How many were asked: what was found equivalent only afterwards is among them."""
        return sum(first in ASKED_VERDICTS for first, _ in self.met)

    def share(self, place):
        """How many of those asked were noticed at first (0) or now (1): the words, and the percentage."""
        verdicts = [met[place] for met in self.met if met[place] in ASKED_VERDICTS]
        noticed = verdicts.count('noticed')
        percent = 100 * noticed / len(verdicts) if verdicts else 0
        return f'noticed {noticed} of {len(verdicts)} ({percent:.1f} %)', percent

    def summary(self):
        count = collections.Counter(verdict for _, verdict in self.met)
        at_first, now = self.share(0)[0], self.share(1)[0]
        return ((f'at first {at_first}\n' if at_first != now else '') +
                f'{now}; apart from these: {count["equivalent"]} equivalent ({EQUIVALENT}), {count["same"]} with the same '
                f'machine code, {count["nocompile"]} that did not compile')


def drawn(arguments, build):
    files = subprocess.check_output(['git', 'ls-files', '-co', '--exclude-standard', *arguments.rooms], text=True).split()
    files = [f for f in files if f in build.compile and not any(s in f for s in SKIPPED_FILES)]
    mutants = [m for f in files for m in mutants_of(f, arguments.seed)]
    return sorted(mutants, key=lambda m: m.rank)


def ask(mutants, arguments, trials, report):
    """Goes on until COUNT of them compiled and are not known to be equivalent."""
    known, iterator, taking = equivalents(), iter(mutants), threading.Lock()

    def work(folder):
        while True:
            with taking:
                wanted = report.asked() + work.pending < arguments.count and not work.failed
                mutant = next(iterator, None) if wanted else None
                if mutant is None:
                    return
                work.pending += 1
            reason = known.get((mutant.path, mutant.original, mutant.changed))
            try:
                verdict, by = ('equivalent', reason) if reason else report.earlier(mutant) or trials.verdict(mutant, folder)
            except BaseException:
                work.failed = True  # the others end too, and it is raised below
                raise
            with taking:
                work.pending -= 1
                report.add(mutant, verdict, by)

    work.pending, work.failed = 0, False
    with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
        for done in [pool.submit(work, trials.folder(i)) for i in range(arguments.jobs)]:
            done.result()


def parsed():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('seed', nargs='?', default='1')
    parser.add_argument('count', nargs='?', type=int, default=40)
    parser.add_argument('rooms', nargs='*', default=ROOMS, metavar='ROOM', choices=ROOMS + [ROOMS])
    parser.add_argument('-j', '--jobs', type=int, default=int(os.environ.get('DUET_JOBS', os.cpu_count())))
    parser.add_argument('--gate', type=float, default=0, metavar='PERCENT', help='exit 1 where fewer are noticed')
    parser.add_argument('--control', type=int, default=0, metavar='N', help='first the recipe with N files unchanged')
    parser.add_argument('--quick', action='store_true', help='only the file compiled alone and the tests of its room: what these let pass waits')
    parser.add_argument('--again', action='store_true', help='with --quick: ask again what passed in earlier calls')
    parser.add_argument('--list', action='store_true', help='print the draw and try nothing')
    parser.add_argument('--build', default='build/release', metavar='FOLDER')
    return parser.parse_args()


def main():
    os.chdir(pathlib.Path(__file__).resolve().parent.parent)
    arguments = parsed()
    build = Build(arguments.build)
    mutants = drawn(arguments, build)
    if arguments.list:
        print('\n'.join(str(m) for m in mutants[:arguments.count]))
        return 0
    scratch = pathlib.Path('build/mutants').resolve()
    scratch.mkdir(parents=True, exist_ok=True)
    settled = ['noticed', 'nocompile', 'same'] + ['unnoticed', 'SURVIVED'] * (arguments.quick and not arguments.again)
    trials, report = Trials(build, scratch, arguments.quick), Report(scratch, arguments.seed, settled)
    for path in list(dict.fromkeys(m.path for m in mutants))[:arguments.control]:
        if complaint := trials.control(path, trials.folder(0)):
            report.say(complaint)
            return 1
    began = time.monotonic()
    ask(mutants, arguments, trials, report)
    report.say(f'{report.summary()}; seed {arguments.seed}, {len(mutants)} to draw from, {time.monotonic() - began:.0f} s')
    return 1 if report.share(1)[1] < arguments.gate else 0


if __name__ == '__main__':
    sys.exit(main())
