#!/usr/bin/env python3
"""In the guest: the driver of SocketCAN before the kernel's own virtual bus.  can_guest.py BUILD DATA

Runs the tests of drivers_can_test that need a bus: classic and FD frames, error frames, frames that the kernel dropped, silence, foreign
frames, a missing leg, an interface that goes down. Prints how soon each trouble was said, and over.
"""
import json
import subprocess
import sys
from pathlib import Path

import guest


def main():
    build = Path(sys.argv[1])
    guest.raise_can_bus("vcan1")
    report = Path("/tmp/can.json")
    code = subprocess.run([build / "tests/drivers_can_test", "--gtest_filter=Vcan*", f"--gtest_output=json:{report}"],
                          check=False).returncode
    guest.check(code == 0, "the tests on vcan1 pass", code)
    tests = [test for suite in json.loads(report.read_text())["testsuites"] for test in suite["testsuite"]]
    guest.check(tests and all(test["result"] == "COMPLETED" for test in tests), f"none of the {len(tests)} is skipped",
                [test["name"] for test in tests if test["result"] != "COMPLETED"])
    print("| CAN test | seen after [ms] | well after [ms] |\n|---|---|---|")
    for test in tests:
        if "well_after_ms" in test:
            print(f"| {test['name']} | {test.get('seen_after_ms', '')} | {test['well_after_ms']} |")
    return guest.summary()


if __name__ == "__main__":
    sys.exit(main())
