"""cmake/check_prose.py: each rule finds the fault that it is for, and says nothing of a page without faults."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
SENTENCE = "The development packages that duet was built with have to be there, all of them."
PROGRAM = """#!/bin/sh
case "$*" in
  --help) printf 'Options:\\n  -h,--help\\n\\nSubcommands:\\n  run    rolls out\\n  dataset   data\\n\\n' ;;
  'run --help') printf 'Options:\\n  -o,--output TEXT\\n  --engines TEXT\\n' ;;
  'dataset --help') printf 'Options:\\n  -h,--help\\n\\nSubcommands:\\n  curate   people\\n\\n' ;;
  'dataset curate --help') printf 'Options:\\n  --gates TEXT\\n' ;;
  *) exit 2 ;;
esac
"""


class Prose(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.path = pathlib.Path(self.folder.name)

    def found(self, *texts, names=("page.md", "other.md"), program=False):
        paths = [self.path / name for name in names[:len(texts)]]
        for path, text in zip(paths, texts):
            path.write_text(text)
        more = []
        if program:
            (self.path / "duet").write_text(PROGRAM)
            (self.path / "duet").chmod(0o755)
            more = ["--program", str(self.path / "duet")]
        done = subprocess.run([sys.executable, str(ROOT / "cmake/check_prose.py"), *more, *map(str, paths)], capture_output=True, text=True, check=False)
        self.assertEqual(done.stderr, "")
        self.assertEqual(done.returncode, 0 if "documents agree" in done.stdout else 1, done.stdout)
        return done.stdout

    def test_a_page_without_faults_passes(self):
        self.assertIn("1 documents agree", self.found(f"# A\n\n{SENTENCE}\n\n| a | b |\n|---|---|\n| 1 | 2 |\n\n[here](#a)\n"))

    def test_a_paragraph_twice(self):
        self.assertIn("page.md:3: begins as line 1 does", self.found(f"{SENTENCE} Then\nmore\n{SENTENCE}\n"))
        self.assertIn("page.md:3: begins as line 1 does", self.found(f"{SENTENCE}\n\nSo. {SENTENCE}\n"))
        self.assertIn("agree", self.found(f"{SENTENCE}\n\n## Another chapter\n\n{SENTENCE}\n"))
        self.assertIn("agree", self.found(f"```\n{SENTENCE}\n{SENTENCE}\n```\n"))

    def test_one_statement_in_other_words(self):
        self.assertIn("page.md:3: counts what line 1 counts: 0 of 5, 4 to 5 of 5",
                      self.found("It has 0 of 5 in playback and 4 to 5 of 5 in engines.\n\nThere 4 to 5 of 5 succeed, in playback 0 of 5.\n"))

    def test_two_tables_of_one_head(self):
        table = "| mean | best |\n|---|---|\n| 1 | 2 |\n"
        self.assertIn("page.md:5: a second table of the head '| mean | best |'", self.found(f"{table}\n{table}"))
        self.assertIn("agree", self.found(f"{table}\nWith other clips:\n\n{table}"))

    def test_links_to_headings(self):
        self.assertIn("leads to 'other.md#no', which has no such heading", self.found("[x](other.md#no)\n", "# Yes\n"))
        self.assertIn("agree", self.found("[x](other.md#yes-and-no) [y](https://a.b/c.md#d)\n", "# `Yes` and no\n"))

    def test_facts_that_the_tree_knows(self):
        self.assertIn("says '11 to 17' of the ONNX operator sets", self.found("It takes operator sets 11 to 17.\n"))
        self.assertIn("of the suites whose partner is solid", self.found("In every suite but `contact.yaml` it is a ghost.\n"))
        self.assertIn("says 'eight' of the levels", self.found("It asks at eight levels.\n"))
        self.assertIn("says '11' of the recordings of SBU", self.found("and 11 more were refused.\n"))

    def test_choices_that_another_page_has_otherwise(self):
        row = "| R22 | bodies may lie in each other | spheres repel, `w-collision=10` | reason | `w-collision=0` |\n"
        self.assertIn("says 'w-collision=10', and docs/retargeting.md has", self.found(row, names=("deviations.md",)))

    def test_regions_of_one_name(self):
        region = "<!-- same: time -->{}<!-- end same -->\n"
        self.assertIn("other.md:1: 'time' is '20 min' here and '17 min' in page.md:1", self.found(region.format("17 min"), region.format("20 min")))
        self.assertIn("agree", self.found(region.format("17 min"), region.format("17\nmin")))

    def test_commands_that_the_program_does_not_have(self):
        page = "```\nduet run a.yaml --engine ode\nduet dataset export x\nduet dataset curate x \\\n  --gate y\n```\nAnd `duet walks`.\n"
        said = self.found(page, program=True)
        self.assertIn("page.md:2: 'duet run a.yaml --engine ode': 'run' has no option '--engine'", said)
        self.assertIn("page.md:3: 'duet dataset export x': there is no command 'dataset export'", said)
        self.assertIn("page.md:4: 'duet dataset curate x --gate y': 'dataset curate' has no option '--gate'", said)
        self.assertIn("page.md:7: 'duet walks': there is no command 'walks'", said)
        self.assertIn("agree", self.found("`duet run a.yaml --engines ode -o x`, `duet dataset curate x --gates y`\n", program=True))


if __name__ == "__main__":
    unittest.main()
