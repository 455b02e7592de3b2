#!/usr/bin/env python3
"""What the tests of the last ctest said, over all programs: how many passed, which failed, which were skipped and why.

  tests/summary.py LOG             LOG is build/release/Testing/Temporary/LastTest.log
  tests/summary.py LOG --gate      exit code 1 where a test was skipped whose name tests/skips.txt lacks

GoogleTest prints a line a test; ctest keeps all of them in its log.
"""

import os
import re
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
ENDED = re.compile(r"\[ +(OK|FAILED|SKIPPED) +\] ([\w/]+\.[\w/]+)(?:, where .*)? \(\d+ ms\)")
REASON = re.compile(r"^(not run: .*|.* absent.*)$")


def read(path):
    """Results by name, and the reason of each that was skipped."""
    results, reasons, last = {}, {}, ""
    with open(path, encoding="utf-8", errors="replace") as file:
        for line in file:
            ended = ENDED.match(line)
            if not ended:
                if REASON.match(line.strip()):
                    last = line.strip()
                continue
            results[ended[2]] = ended[1]
            if ended[1] == "SKIPPED":
                reasons[ended[2]] = last or "no reason said"
            last = ""
    return results, reasons


def plain(name):
    """The test that an instance with parameters is of: "Engines/Walk.Stands/3" is Walk.Stands."""
    suite, test = name.split(".")
    return f"{suite.split('/')[-1]}.{test.split('/')[0]}"


def main(arguments):
    if not arguments or arguments[0] in ("-h", "--help"):
        print(__doc__)
        return 0
    results, reasons = read(arguments[0])
    with open(os.path.join(HERE, "skips.txt"), encoding="utf-8") as file:
        expected = {line.strip() for line in file if line.strip() and not line.startswith("#")}
    of = lambda outcome: sorted(name for name, found in results.items() if found == outcome)
    for name in of("SKIPPED"):
        print(f"skipped: {name} ({reasons[name]})" + ("" if plain(name) in expected else "; tests/skips.txt does not expect it"))
    for name in of("FAILED"):
        print(f"failed: {name}")
    surprising = [name for name in of("SKIPPED") if plain(name) not in expected]
    print(f"tests: {len(of('OK'))} passed, {len(of('FAILED'))} failed, {len(of('SKIPPED'))} skipped, "
          f"{len(surprising)} of them not expected")
    return 1 if "--gate" in arguments and (surprising or not results) else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
