#!/usr/bin/env python3
"""Changes one operator of the product at a time and asks whether a test notices.

  ./run mutants [SEED] [COUNT] [ROOM...]     (builds first; SEED 1, COUNT 40, all rooms)

A changed file is compiled with the command of its build, and with the files that are compiled together with it, in a
scratch folder (build/mutants), and linked in front of the room's library; the source tree and the build are only read.
Then the tests of its room run, those first that include the file's header, and after them the tests of every room that
links it: a changed engine, library or command reaches them through DUET_ENGINES and DUET_PROGRAM. A test that fails, a
crash and a run out of its time limit have noticed the change.

What is not drawn: headers; lines of `for (`, `require(`, `throw` and `fmt::` (loops that run out of an array and words of
messages); bench/benchmarks and the engines' bare loops (what they give is time); code for libtorch and the command that
runs it. A change that gives
the same machine code, or that stands in tests/mutants_equivalent.txt with its reason, is counted apart.

The draw depends on the seed and on the lines alone, so that a commit elsewhere leaves it as it is. A second call with the
same seed goes on where the first ended; it asks again only what survived. Report: build/mutants/SEED.txt.
"""
import argparse
import concurrent.futures
import hashlib
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

ROOMS = 'core tasks motion robots nn io formats retarget backends controllers policies metrics rollout results datasets training bench'.split()
OPERATORS = [(r' < ', ' <= '), (r' <= ', ' < '), (r' > ', ' >= '), (r' >= ', ' > '), (r' \+ ', ' - '), (r' - ', ' + '),
             (r' \* ', ' + '), (r' / ', ' * '), (r' \+= ', ' -= '), (r' -= ', ' += '), (r' && ', ' || '),
             (r' \|\| ', ' && '), (r' == ', ' != '), (r' != ', ' == '), (r'std::max\(', 'std::min('),
             (r'std::min\(', 'std::max('), (r'\b0\.5\b', '0.6'), (r'return true;', 'return false;'),
             (r'return false;', 'return true;'), (r'if \(!', 'if ('), (r'\[0\]', '[1]')]
SKIPPED_LINES = ('require(', 'throw ', 'fmt::', '#', 'template', 'for (', 'using ', 'typedef', 'static_assert')
SKIPPED_FILES = ('bench/benchmarks/', '/bare_loop.cpp', '/torch/', 'libtorch_peer.cpp', 'libtorch_network.cpp', 'cli/train_dstar.cpp')
EQUIVALENT = 'tests/mutants_equivalent.txt'
OUTPUT = re.compile(r'(?<= -o )\S+')
MEMORY = 12 << 30


def code_of(line):
    """The line with comments and the insides of strings blanked, so that only code is changed."""
    line = re.sub(r'"(\\.|[^"\\])*"|\'(\\.|[^\'\\])\'', lambda m: m[0][0] + ' ' * (len(m[0]) - 2) + m[0][0], line)
    return re.sub(r'//.*', lambda m: ' ' * len(m[0]), line)


class Mutant:
    def __init__(self, path, number, line, span, new, seed):
        self.path, self.number, self.original = path, number, line.strip()
        self.line = line[:span[0]] + new + line[span[1]:]
        self.changed = self.line.strip()
        identity = f'{path}\n{self.original}\n{span[0] - len(line) + len(line.lstrip())}\n{new}'
        self.key = hashlib.sha256(identity.encode()).hexdigest()[:16]
        self.rank = hashlib.sha256(f'{seed}\n{self.key}\n{number}'.encode()).hexdigest()

    def __str__(self):
        return f'{self.path}:{self.number}  {self.original}  =>  {self.changed}'


def mutants_of(path, seed):
    for i, line in enumerate(pathlib.Path(path).read_text().split('\n')):
        code = code_of(line)
        if any(word in code for word in SKIPPED_LINES) or code.strip().startswith('*'):
            continue
        for old, new in OPERATORS:
            for found in re.finditer(old, code):
                yield Mutant(path, i + 1, line, found.span(), new, seed)


def equivalents():
    """{(path, line, changed line): reason} of the kept list; says which of its entries fit no line any more."""
    known, path, old, new = {}, '', '', ''
    for line in pathlib.Path(EQUIVALENT).read_text().splitlines():
        sign, text = line[:2], line[2:].strip()
        if sign == '@ ':
            path = text
        elif sign == '- ':
            old = text
        elif sign == '+ ':
            new = text
        elif sign == '= ':
            known[path, old, new] = text
    for path, old, _ in known:
        if not os.path.exists(path) or old not in [x.strip() for x in pathlib.Path(path).read_text().split('\n')]:
            print(f'{EQUIVALENT}: {path} has no line "{old}" any more', file=sys.stderr)
    return known


class Build:
    """What the build knows: how each file is compiled, how each program and module is linked."""

    def __init__(self, folder):
        self.folder = os.path.abspath(folder)
        self.compile, self.unit = {}, {}  # of a file: the command, and the several files that are compiled at once
        for entry in json.load(open(f'{self.folder}/compile_commands.json')):
            united = os.path.basename(entry['file']).startswith('unity_')
            files = re.findall(r'#include "(.*)"', pathlib.Path(entry['file']).read_text()) if united else [entry['file']]
            for file in map(os.path.relpath, files):
                self.compile[file] = entry['command']
                if united:
                    self.unit[file] = entry['file']
        self.links = {}
        for command in subprocess.check_output(['ninja', '-C', self.folder, '-t', 'commands'], text=True).split('\n'):
            found = OUTPUT.search(command)
            if command.startswith(': && ') and found and ' -c ' not in command:
                self.links[found[0]] = command[len(': && '):].split(' && ')[0]
        self.programs = {r: f'tests/{r}/{r}_test' for r in ROOMS if f'tests/{r}/{r}_test' in self.links}
        self.engines = [out for out in self.links if out.startswith('engines/')]

    def object_of(self, path):
        return OUTPUT.search(self.compile[path])[0]

    def library_of(self, path):
        room = path.split('/')[0]
        return f'{room}/libduet_{room}.a'

    def holds(self, target, path):
        """Whether the target is linked from this file's object or from its room's library."""
        words = self.links[target].split()
        in_library = f'/duet_{path.split("/")[0]}.dir/' in self.object_of(path)
        return self.object_of(path) in words or (in_library and self.library_of(path) in words)

    def link(self, target, path, object_file, output):
        command = OUTPUT.sub(output, self.links[target])
        if self.object_of(path) in command.split():
            command = command.replace(f' {self.object_of(path)} ', f' {object_file} ')
        else:
            command = command.replace(f' {self.library_of(path)} ', f' {object_file} {self.library_of(path)} ', 1)
        done = subprocess.run(command, shell=True, cwd=self.folder, capture_output=True, text=True)
        if done.returncode:
            sys.exit(f'{target} could not be linked: {done.stderr.strip()}')

    def suites_about(self, path, room):
        """Names of the test suites of the room whose file includes the changed file's header."""
        header = re.sub(r'\.cpp$', '.h', path)
        names = set()
        for test in pathlib.Path(f'tests/{room}').glob('*_test.cpp'):
            text = test.read_text()
            if f'"duet/{header}"' in text or test.stem == pathlib.Path(path).stem + '_test':
                names.update(re.findall(r'^TEST(?:_[FP])?\((\w+),', text, re.M))
        if '/cli/' in path:
            names.add('CommandLine')
        return sorted(names)


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


class Trials:
    def __init__(self, build, scratch):
        self.build, self.scratch, self.lock = build, scratch, threading.Lock()

    def cpu_seconds(self, room):
        """The limit for the tests of a room: five times what they take unchanged, where they have to pass."""
        file = self.scratch / 'baseline.json'
        program = f'{self.build.folder}/{self.build.programs[room]}'
        stamp = os.stat(program).st_mtime
        with self.lock:
            known = json.loads(file.read_text()) if file.exists() else {}
            if known.get(room, [0, 0])[0] != stamp:
                log = self.scratch / f'baseline-{room}.log'
                noticed, seconds = run_tests(program, '', dict(os.environ), 600, log)
                if noticed:
                    raise SystemExit(f'{room}_test does not pass unchanged: {noticed} ({log})')
                known[room] = [stamp, seconds]
                file.write_text(json.dumps(known))
        return int(20 + 5 * known[room][1])

    def compile(self, folder, path, text):
        """The object file of the changed text, None where it does not compile."""
        source = folder / pathlib.Path(path).name
        source.write_text(text)
        if unit := self.build.unit.get(path):
            others = pathlib.Path(unit).read_text()
            source = folder / 'unity.cpp'
            source.write_text(others.replace(f'"{os.path.abspath(path)}"', f'"{folder / pathlib.Path(path).name}"'))
        output = folder / (source.name + '.o')
        words = self.build.compile[path].split()
        while '=' in words[0] or words[0].endswith(('/cmake', '/ccache')) or words[0] in ('-E', 'env'):
            words.pop(0)  # the launcher: what is compiled here once is of no use in the cache
        command = OUTPUT.sub(str(output), ' '.join(words)).rsplit(' -c ', 1)[0]
        quote = os.path.abspath(os.path.dirname(path))
        done = subprocess.run(f'{command} -w -iquote {quote} -c {source}', shell=True, cwd=self.build.folder,
                              capture_output=True)
        return output if done.returncode == 0 else None

    def same_machine_code(self, path, object_file):
        original = pathlib.Path(self.build.folder) / self.build.object_of(path)
        return original.read_bytes() == object_file.read_bytes()

    def environment(self, folder, path, object_file, room):
        """Engines and program with the change in them, where this room's tests use them."""
        environment = dict(os.environ, TMPDIR=str(folder / 'tmp'))
        shutil.rmtree(folder / 'tmp', ignore_errors=True)
        (folder / 'tmp').mkdir()
        uses_engines = 'libduet_backends.a' in self.build.links[self.build.programs[room]]
        if uses_engines and any(self.build.holds(engine, path) for engine in self.build.engines):
            shutil.rmtree(folder / 'engines', ignore_errors=True)
            (folder / 'engines').mkdir()
            for engine in self.build.engines:
                if self.build.holds(engine, path):
                    self.build.link(engine, path, object_file, str(folder / engine))
                else:
                    (folder / engine).symlink_to(f'{self.build.folder}/{engine}')
            environment['DUET_ENGINES'] = str(folder / 'engines')
        if room == 'bench' and self.build.holds('duet', path):
            self.build.link('duet', path, object_file, str(folder / 'duet'))
            environment['DUET_PROGRAM'] = str(folder / 'duet')
        return environment

    def noticed_by_room(self, folder, path, object_file, room):
        program = self.build.programs[room]
        environment = self.environment(folder, path, object_file, room)
        changed = f'{self.build.folder}/{program}'
        if self.build.holds(program, path):
            changed = str(folder / f'{room}_test')
            self.build.link(program, path, object_file, changed)
        suites = self.build.suites_about(path, room)
        about = ':'.join(f'{name}.*:*/{name}.*' for name in suites)
        noticed, limit = '', self.cpu_seconds(room)
        for filters in ([about, '-' + about] if about else ['']):
            noticed = noticed or run_tests(changed, filters, environment, limit, folder / 'log')[0]
        return noticed

    def rooms_for(self, path):
        """The file's room first, then each room whose tests link it, hold it in an engine or in the program."""
        own = path.split('/')[0]
        held_by_engine = any(self.build.holds(engine, path) for engine in self.build.engines)
        above = [room for room, program in self.build.programs.items() if room != own and (
            self.build.holds(program, path) or
            (held_by_engine and 'libduet_backends.a' in self.build.links[program]))]
        return [own] + above

    def verdict(self, mutant, folder):
        lines = pathlib.Path(mutant.path).read_text().split('\n')
        lines[mutant.number - 1] = mutant.line
        object_file = self.compile(folder, mutant.path, '\n'.join(lines))
        if object_file is None:
            return 'nocompile', ''
        if self.same_machine_code(mutant.path, object_file):
            return 'same', 'the machine code is the same'
        for room in self.rooms_for(mutant.path):
            noticed = self.noticed_by_room(folder, mutant.path, object_file, room)
            if noticed:
                return 'noticed', f'{room}: {noticed}'
        return 'SURVIVED', ''

    def control(self, path, folder):
        """The recipe with nothing changed: says whether a test complains all the same."""
        object_file = self.compile(folder, path, pathlib.Path(path).read_text())
        if object_file is None:
            return f'control: {path} does not compile'
        room = path.split('/')[0]
        noticed = self.noticed_by_room(folder, path, object_file, room)
        return f'control: {path} is unchanged, yet {room}: {noticed}' if noticed else ''


class Report:
    """Verdicts by key in build/mutants/SEED.json, kept from call to call; the text for people beside it."""

    def __init__(self, file):
        self.file, self.lock = file, threading.Lock()
        self.known = json.loads(file.read_text()) if file.exists() else {}
        self.lines, self.count = [], {}

    def add(self, mutant, verdict, by):
        with self.lock:
            self.known[mutant.key] = [verdict, by]
            self.count[verdict] = self.count.get(verdict, 0) + 1
            self.say(f'{verdict:10} {mutant}' + (f'  [{by}]' if by else ''))
            self.file.write_text(json.dumps(self.known))

    def say(self, line):
        self.lines.append(line)
        print(line, flush=True)
        self.file.with_suffix('.txt').write_text('\n'.join(self.lines) + '\n')

    def earlier(self, mutant):
        verdict, by = self.known.get(mutant.key, ['', ''])
        return (verdict, by) if verdict in ('noticed', 'nocompile', 'same') else None

    def asked(self):
        return self.count.get('noticed', 0) + self.count.get('SURVIVED', 0)


def drawn(arguments, build):
    files = subprocess.check_output(['git', 'ls-files', '-co', '--exclude-standard', *arguments.rooms], text=True).split()
    files = [f for f in files if f in build.compile and not any(s in f for s in SKIPPED_FILES)]
    mutants = [m for f in files for m in mutants_of(f, arguments.seed)]
    return sorted(mutants, key=lambda m: m.rank)


def ask(mutants, arguments, trials, report):
    """Goes on until COUNT of them compiled and are not known to be equivalent."""
    known, iterator, taking = equivalents(), iter(mutants), threading.Lock()

    def work(folder):
        folder.mkdir(parents=True, exist_ok=True)
        while True:
            with taking:
                mutant = next(iterator, None) if report.asked() + work.pending < arguments.count else None
                if mutant is None:
                    return
                work.pending += 1
            reason = known.get((mutant.path, mutant.original, mutant.changed))
            verdict, by = ('equivalent', reason) if reason else report.earlier(mutant) or trials.verdict(mutant, folder)
            with taking:
                work.pending -= 1
                report.add(mutant, verdict, by)

    work.pending = 0
    with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
        for done in [pool.submit(work, trials.scratch / f'worker{i}') for i in range(arguments.jobs)]:
            done.result()


def parsed():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('seed', nargs='?', default='1')
    parser.add_argument('count', nargs='?', type=int, default=40)
    parser.add_argument('rooms', nargs='*', default=ROOMS, metavar='ROOM', choices=ROOMS + [ROOMS])
    parser.add_argument('-j', '--jobs', type=int, default=int(os.environ.get('DUET_JOBS', os.cpu_count())))
    parser.add_argument('--gate', type=float, default=0, metavar='PERCENT', help='exit 1 where fewer are noticed')
    parser.add_argument('--control', action='store_true', help='first the recipe with the first file unchanged')
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
    trials, report = Trials(build, scratch), Report(scratch / f'{arguments.seed}.json')
    if arguments.control:
        (scratch / 'worker0').mkdir(exist_ok=True)
        if complaint := trials.control(mutants[0].path, scratch / 'worker0'):
            report.say(complaint)
            return 1
    began = time.monotonic()
    ask(mutants, arguments, trials, report)
    noticed, asked = report.count.get('noticed', 0), report.asked()
    share = 100 * noticed / asked if asked else 0
    report.say(f'noticed {noticed} of {asked} ({share:.1f} %); apart from these: {report.count.get("equivalent", 0)} equivalent '
               f'({EQUIVALENT}), {report.count.get("same", 0)} with the same machine code, '
               f'{report.count.get("nocompile", 0)} that did not compile; seed {arguments.seed}, '
               f'{len(mutants)} to draw from, {time.monotonic() - began:.0f} s')
    return 1 if share < arguments.gate else 0


if __name__ == '__main__':
    sys.exit(main())
