"""Runs the tests of the package: python3 tests/python/run_tests.py PACKAGE_FOLDER PROGRAM [UNITTEST_ARGUMENT...]

PACKAGE_FOLDER is the folder that holds `duet` (build/release/python), or "-" for the package that is installed;
PROGRAM is the command line that it is compared with."""

import os
import sys
import unittest


def main(package, program, arguments):
    here = os.path.dirname(os.path.abspath(__file__))
    sys.path.insert(0, here)
    paths = [here]
    if package != "-":
        sys.path.insert(0, os.path.abspath(package))
        paths.insert(0, os.path.abspath(package))
    os.environ["PYTHONPATH"] = os.pathsep.join(paths)
    os.environ["DUET_PROGRAM"] = os.path.abspath(program)
    tests = arguments or ["test_bridge", "test_evaluate", "test_identity", "test_motion", "test_environment", "test_parallel", "test_package"]
    unittest.main(module=None, argv=["run_tests", *tests], verbosity=2)


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    main(sys.argv[1], sys.argv[2], sys.argv[3:])
