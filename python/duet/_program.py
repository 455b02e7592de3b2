"""The command `duet` of a wheel: the program that lies in the package."""

import os
import sys


def main() -> None:
    program = os.path.join(os.path.dirname(os.path.abspath(__file__)), "bin", "duet")
    if not os.path.exists(program):
        sys.exit(f"duet: {program} is not there: this package was installed without the program")
    os.execv(program, [program, *sys.argv[1:]])
