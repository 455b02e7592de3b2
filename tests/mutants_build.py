"""The changes that `./run mutants` draws from, and how the build compiles and links the files that they are in."""
import hashlib
import json
import os
import pathlib
import re
import subprocess
import sys
import typing

with open(os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), 'cmake', 'rooms.txt'), encoding='utf-8') as rooms:
    ROOMS = [line.split(':')[0] for line in rooms if line[0].isalpha()] + ['parts']
OPERATORS = [(r' < ', ' <= '), (r' <= ', ' < '), (r' > ', ' >= '), (r' >= ', ' > '), (r' \+ ', ' - '), (r' - ', ' + '),
             (r' \* ', ' + '), (r' / ', ' * '), (r' \+= ', ' -= '), (r' -= ', ' += '), (r' && ', ' || '),
             (r' \|\| ', ' && '), (r' == ', ' != '), (r' != ', ' == '), (r'std::max\(', 'std::min('),
             (r'std::min\(', 'std::max('), (r'\b0\.5\b', '0.6'), (r'return true;', 'return false;'),
             (r'return false;', 'return true;'), (r'if \(!', 'if ('), (r'\[0\]', '[1]')]
SKIPPED_LINES = ('require(', 'throw ', 'fmt::', '#', 'template', 'for (', 'using ', 'typedef', 'static_assert')
SKIPPED_FILES = ('app/benchmarks/', '/benchmarks.cpp', '_benchmark.cpp', '/bare_loop.cpp', '/torch/', 'libtorch_peer.cpp', 'libtorch_network.cpp', 'parts/training/train.cpp')
EQUIVALENT = 'tests/mutants_equivalent.txt'
OUTPUT = re.compile(r'(?<= -o )\S+')


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


class Compiled(typing.NamedTuple):
    path: str
    object: pathlib.Path
    united: bool  # compiled with its neighbours, as in the build

    def has_variables(self):
        """Whether a program that holds the file twice may behave otherwise: it is initialised twice, or counts apart."""
        sizes = subprocess.check_output(['size', '-A', self.object], text=True)
        return re.search(r'^\.(init_array|t?data|t?bss) +[1-9]', sizes, re.M) is not None


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

    def link(self, target, changed, output):
        """With the changed object in place of what it was in the build, or before that where it is the file alone."""
        command = OUTPUT.sub(output, self.links[target])
        holder = self.object_of(changed.path)
        if holder not in command.split():
            holder = self.library_of(changed.path)
        keeps = not changed.united or holder.endswith('.a')
        command = command.replace(f' {holder} ', f' {changed.object} {holder} ' if keeps else f' {changed.object} ', 1)
        command += '' if changed.united else ' -Wl,--allow-multiple-definition'
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
