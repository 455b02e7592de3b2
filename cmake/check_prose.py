#!/usr/bin/env python3
"""Says where documents contradict themselves, one another or the program.

  cmake/check_prose.py [--program build/release/duet] [DOCUMENT...]

Each rule below looks for one kind of fault that a reader once found. Without documents: all of the tree. The program is asked for the
options of its commands; without it command lines are not looked at. Two figures that have to be one stand between
`<!-- same: NAME -->` and `<!-- end same -->`, each in its document. Exit code 1 where anything is found.
"""
import argparse
import functools
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
LONG = 60  # letters from which two sentences that begin alike are one sentence twice
NEAR = 15  # lines within which the same counts are the same statement
COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
SAME = re.compile(r"<!-- same: ([^>]*?) -->(.*?)<!-- end same -->", re.DOTALL)


def documents():
    """Markdown, and the suites, whose comments say what they ask. Without a list of Git: what is there."""
    names = [path.relative_to(ROOT) for pattern in ("*.md", "docs/**/*.md", "examples/**/*.md", "controllers/**/*.md", "policies/**/*.md",
                                                    "backends/**/*.md", "suites/*.yaml") for path in ROOT.glob(pattern)]
    return [ROOT / name for name in sorted(set(names)) if name.name != "CHANGELOG.md"]


def outside_code(text):
    """Lines with their numbers, without those of code blocks."""
    inside = False
    for number, line in enumerate(text.splitlines(), 1):
        if line.lstrip().startswith("```"):
            inside = not inside
        elif not inside:
            yield number, line


def code_lines(text):
    """Lines of code blocks, and what stands between backticks elsewhere; a line that ends in a backslash goes on."""
    inside, begun, whole = False, 0, ""
    for number, line in enumerate(text.splitlines(), 1):
        if line.lstrip().startswith("```"):
            inside, whole = not inside, ""
        elif inside:
            begun, whole = (begun, whole) if whole else (number, "")
            whole += line.rstrip("\\").strip() + " "
            if not line.endswith("\\"):
                yield begun, whole.strip()
                whole = ""
        else:
            for code in re.findall(r"`([^`]+)`", line):
                yield number, code


def without_comments(text):
    """The same lines."""
    return COMMENT.sub(lambda comment: "\n" * comment[0].count("\n"), text)


# Paragraphs that stand twice in a chapter: two lines, or two sentences, that begin alike.
def doubled(text):
    first = {}
    for number, line in outside_code(without_comments(text)):
        if re.match("##? ", line):
            first = {}
        if line.lstrip().startswith(("|", "#", "![", "[")):
            continue
        pieces = {line.strip()} | {piece.strip() for piece in re.split(r"(?<=[.:?!]) ", line)}
        for piece in sorted(pieces):
            begin = piece[:LONG]
            if len(begin) < LONG:
                continue
            if begin in first and first[begin] != number:
                yield number, f"begins as line {first[begin]} does: '{begin}...'"
            first.setdefault(begin, number)


# One statement in other words: two lines near each other with two counts ("0 of 5", "4 to 5 of 5") in common.
def doubled_counts(text):
    before = []
    for number, line in outside_code(without_comments(text)):
        counts = set() if line.lstrip().startswith("|") else set(re.findall(r"\d+(?: to \d+)? of [\d,]*\d", line))
        for other, known in before:
            if len(counts & known) > 1 and 1 < number - other <= NEAR:
                yield number, f"counts what line {other} counts: {', '.join(sorted(counts & known))}"
        before.append((number, counts))


# Two tables under one another with one head, and no sentence between them that says what the second one is.
def doubled_tables(text):
    head, lines = None, list(outside_code(without_comments(text)))
    for (number, line), (_, after) in zip(lines, lines[1:]):
        if re.fullmatch(r"\|[ :|-]+\|", after.strip()) and line.lstrip().startswith("|"):
            cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
            if head == cells:
                yield number, f"a second table of the head '{line.strip()}', and not a word between the two"
            head = cells
        elif line.strip() and not line.lstrip().startswith("|"):
            head = None


# Links to a heading that is not there. Files that are not there are found by check_docs.sh.
def anchors(path):
    found = {}
    for _, line in outside_code(path.read_text(encoding="utf-8")):
        if match := re.match(r"#+ +(.*)", line):
            words = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", match[1]).replace("`", "").lower()
            slug = "".join(c for c in words.strip() if c.isalnum() or c in " -_").replace(" ", "-")
            count = found.get(slug, 0)
            found[slug] = count + 1
            if count:
                found[f"{slug}-{count}"] = 1
    return set(found)


def broken_links(path, text):
    for number, line in outside_code(text):
        for file, anchor in re.findall(r"\]\(([^)# ]*)#([^) ]+)\)", line):
            target = (path.parent / file) if file else path
            if not re.match(r"[a-z]+:", file) and target.suffix == ".md" and target.exists() and anchor not in anchors(target):
                yield number, f"leads to '{file}#{anchor}', which has no such heading"


@functools.cache
def options_of(program, command):
    """(options, commands) that `duet COMMAND --help` shows, or None where there is no such command."""
    done = subprocess.run([program, *command, "--help"], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        return None
    listed = done.stdout.split("Subcommands:")
    commands = re.findall(r"^  ([a-z][a-z-]*) ", listed[1].split("\n\n")[0], re.MULTILINE) if len(listed) > 1 else []
    return set(re.findall(r"(?<![\w-])--?[a-zA-Z][\w-]*", listed[0])), set(commands)


# Commands and options that the program does not have.
def wrong_commands(program, text):
    for number, code in code_lines(text):
        for line in re.split(r"&&|\|\||[;|]", code.split(" #")[0]):
            words = line.replace("$ ", "").replace('"$program"', "duet").split()
            if len(words) < 2 or words[0] not in ("duet", "build/release/duet"):
                continue
            yield from ((number, f"'{line.strip()}': {fault}") for fault in faults_of(program, words[1:]))


def faults_of(program, words):
    command = ()
    known, commands = options_of(program, command)
    while words and commands:
        if not re.fullmatch(r"[a-z][a-z-]*", words[0]):
            break
        if words[0] not in commands:
            yield f"there is no command '{' '.join(command + (words[0],))}'"
            return
        command += (words.pop(0),)
        known, commands = options_of(program, command)
    for word in words:
        option = word.strip("[]()'\",.:").split("=")[0]
        if re.fullmatch(r"--[a-z][\w-]*|-[a-zA-Z]", option) and option not in known:
            yield f"'{' '.join(command)}' has no option '{option}'"


# Figures that have one place to come from: what is written in a document, and what the tree says.
def read(name):
    return (ROOT / name).read_text(encoding="utf-8")


def operator_sets():
    oldest, newest = re.search(r"kOldestOpset = (\d+), kNewestOpset = (\d+)", read("nn/onnx/onnx_model.h")).groups()
    return f"{oldest} to {newest}"


def levels():
    names = "zero one two three four five six seven eight nine ten eleven twelve".split()
    return names[len(re.findall(r"name: level_\d", read("suites/hard.yaml"))) + 1]


def solid_suites():
    return " and ".join(f"`{path.name}`" for path in sorted((ROOT / "suites").glob("*.yaml")) if re.search("^partner: solid", path.read_text(), re.M))


def sbu_refused():
    return re.search(r"^\| rejected +\| +(\d+)", read("docs/datasets.md"), re.MULTILINE)[1]


FACTS = [
    (r"(\d+) more were refused", sbu_refused, "the recordings of SBU that the gates refuse (docs/datasets.md)"),
    (r"operator sets (\d+ to \d+)", operator_sets, "the ONNX operator sets that nn/onnx/onnx_model.h takes"),
    (r"(?i)(?:at (?=\w+ levels)|(?=\w+ levels from easy))(\w+) levels", levels, "the levels of suites/hard.yaml, level 0 counted"),
    (r"every suite but ((?:`\w+\.yaml`(?:, | and )?)+)", solid_suites, "the suites whose partner is solid"),
]


def stale_facts(text):
    for pattern, source, what in FACTS:
        for match in re.finditer(pattern, text):
            said, true = match[1].strip().rstrip(",").removesuffix(" and").lower(), source()
            if said != true:
                yield text.count("\n", 0, match.start()) + 1, f"says '{said}' of {what}: '{true}'"


def weights_of_modes():
    """Values of each option in the table of modes of docs/retargeting.md."""
    table = {}
    for name, cells in re.findall(r"^\| `([\w-]+)`[^|]*\|(.*)\|$", read("docs/retargeting.md"), re.MULTILINE):
        table.setdefault(name, [cell.strip() for cell in cells.split("|")])
    return table


# The third column of docs/deviations.md is what duet chose; docs/retargeting.md has a table of the same options.
def stale_choices(text):
    modes = weights_of_modes()
    for number, line in outside_code(text):
        cells = [cell.strip() for cell in line.split(" | ")]
        if not re.match(r"\| R\d+ ", line) or len(cells) < 4:
            continue
        for name, value in re.findall(r"`([\w-]+)=([\w.-]+)`", cells[2]):
            if name in modes and value not in modes[name]:
                yield number, f"says '{name}={value}', and docs/retargeting.md has {' | '.join(modes[name])}"


# Regions that bear one name have one content, wherever they stand.
def unequal_regions(texts):
    first = {}
    for path, text in texts.items():
        for match in SAME.finditer(text):
            number, content = text.count("\n", 0, match.start()) + 1, " ".join(match[2].split())
            place, known = first.setdefault(match[1], (f"{path.name}:{number}", content))
            if content != known:
                yield path, number, f"'{match[1]}' is '{content}' here and '{known}' in {place}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="")
    parser.add_argument("documents", nargs="*", type=pathlib.Path)
    given = parser.parse_args()
    texts = {path: path.read_text(encoding="utf-8") for path in given.documents or documents()}
    found = [(path, number, fault) for path, number, fault in unequal_regions(texts)]
    for path, text in texts.items():
        rules = [stale_facts(text)]
        if path.suffix == ".md":
            rules += [doubled(text), doubled_counts(text), doubled_tables(text), broken_links(path, text)]
        if path.name == "deviations.md":
            rules.append(stale_choices(text))
        if given.program and path.suffix == ".md":
            rules.append(wrong_commands(given.program, text))
        found += [(path, number, fault) for rule in rules for number, fault in rule]
    for path, number, fault in found:
        print(f"{path.relative_to(ROOT) if path.is_relative_to(ROOT) else path}:{number}: {fault}")
    if not found:
        print(f"prose: {len(texts)} documents agree with themselves, one another and the program")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
