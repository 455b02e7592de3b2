"""cmake/figures.py: a table that is not what its source prints is found, and what cannot be made is refused in one sentence."""
import json
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
ENGINES = "<!-- figures: engines results/tables/policies -->"
END = "<!-- end -->"


class Figures(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.page = pathlib.Path(self.folder.name) / "page.md"
        self.addCleanup(self.folder.cleanup)

    def run_on(self, text, *arguments):
        self.page.write_text(text)
        return subprocess.run([sys.executable, str(ROOT / "cmake/figures.py"), *arguments, str(self.page)], capture_output=True, text=True, check=False)

    def refused(self, text, *arguments):
        done = self.run_on(text, *arguments)
        self.assertEqual(done.returncode, 1, done.stdout)
        self.assertEqual(self.page.read_text(), text)
        return done.stderr

    def test_a_region_is_written_and_then_holds(self):
        self.assertEqual(self.run_on(f"before\n{ENGINES}\nold\n{END}\nafter\n").returncode, 0)
        text = self.page.read_text()
        self.assertTrue(text.startswith(f"before\n{ENGINES}\n\n| Policy | MuJoCo |") and text.endswith(f"\n\n{END}\nafter\n"), text)
        self.assertEqual(self.run_on(text, "--check").returncode, 0)

    def test_a_digit_that_differs_is_found_and_left(self):
        self.run_on(f"{ENGINES}\n{END}\n")
        stale = self.page.read_text().replace("98.1", "98.2")
        done = self.run_on(stale, "--check")
        self.assertEqual(done.returncode, 1)
        self.assertIn("page.md:1: is not what 'engines results/tables/policies' prints", done.stdout)
        self.assertEqual(self.page.read_text(), stale)

    def test_a_region_without_an_end_is_refused(self):
        self.assertIn("line 2: the region 'engines results/tables/policies' has no '<!-- end -->'", self.refused(f"a\n{ENGINES}\nb\n"))
        self.assertIn("before the next begins", self.refused(f"{ENGINES}\n{ENGINES}\n{END}\n"))

    def test_what_is_no_source_is_refused(self):
        self.assertIn("line 1: 'engine x' is none of: success FOLDER", self.refused(f"<!-- figures: engine x -->\n{END}\n"))
        self.assertIn("no file results/none/engines.csv", self.refused(f"<!-- figures: engines results/none -->\n{END}\n"))

    def pictures(self, change):
        chosen = json.loads((ROOT / "docs/pictures/interaction.json").read_text())
        change(chosen["tasks"])
        path = pathlib.Path(self.folder.name) / "chosen.json"
        path.write_text(json.dumps(chosen))
        return f"<!-- figures: pictures {path} -->\n{END}\n"

    def test_pictures_say_what_fails_and_hold_against_the_rows(self):
        self.assertEqual(self.run_on(self.pictures(lambda tasks: None)).returncode, 0)
        rows = self.page.read_text().splitlines()[4:-2]
        self.assertEqual(len(rows), 6)
        for row in rows:
            self.assertIn("**All conditions hold.**", row.split("|")[2])
            self.assertRegex(row.split("|")[3], r"\*\*Fails (`\w+`(, )?)+\.\*\*")

    def test_a_picture_of_a_failure_is_none_of_what_is_right(self):
        def swap(tasks):
            tasks["hug"]["right"], tasks["hug"]["wrong"] = tasks["hug"]["wrong"], tasks["hug"]["right"]
        wrong = json.loads((ROOT / "docs/pictures/interaction.json").read_text())["tasks"]["hug"]["wrong"]
        self.assertIn(f"hug, right: expected one episode of {wrong['policy']} with {wrong['clip']} that is right, found 0",
                      self.refused(self.pictures(swap)))

    def test_conditions_count_every_policy(self):
        self.run_on(f"<!-- figures: conditions results/published/interaction -->\n{END}\n")
        lines = self.page.read_text().splitlines()
        self.assertEqual(lines[2], "| Policy | n | act | alone | touch | force | reply | stands |")
        rows = (ROOT / "results/published/interaction/episodes.jsonl").read_text().splitlines()
        self.assertEqual(len(lines[4:-2]), len({json.loads(row)["policy"] for row in rows}))

    def test_a_partner_beside_themselves_makes_no_difference(self):
        self.run_on(f"<!-- figures: partners results/published/interaction results/published/interaction -->\n{END}\n")
        lines = self.page.read_text().splitlines()
        self.assertIn("| Hug | Handshake |", lines[2])
        for line in lines[4:-2]:
            for cell in line.split(" | ")[1:]:
                before, after = re.split(" → | : ", cell.rstrip(" |"))
                self.assertEqual(before, after)
        replay = next(line for line in lines if line.startswith("| replay (knows the motion) |"))
        self.assertIn("| 4 → 4 | 0 → 0 | 4 → 4 | 0 : 0 | 24 of 33 → 24 of 33 |", replay)

    def test_a_command_that_fails_is_refused_with_what_it_said(self):
        self.assertIn("ended with 1", self.refused(f"<!-- figures: duet list -->\n{END}\n", "--program", "/bin/false"))

    def test_what_a_program_prints_is_a_block(self):
        self.run_on(f"<!-- figures: duet a b -->\n{END}\n", "--program", "/bin/echo")
        self.assertEqual(self.page.read_text(), f"<!-- figures: duet a b -->\n\n```\na b\n```\n\n{END}\n")

    def test_long_figures_are_listed_with_their_command(self):
        done = self.run_on("a\n<!-- long: duet bench -->\n", "--long")
        self.assertEqual(done.stdout, f"{self.page}:2: duet bench\n")


if __name__ == "__main__":
    unittest.main()
