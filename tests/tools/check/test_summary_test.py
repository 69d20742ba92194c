import io
import tempfile
import unittest
from pathlib import Path

import test_summary

SKIPPED = """<testcase name="Replay.Kitchen" status="notrun"><skipped message="SKIP_REGULAR_EXPRESSION_MATCHED"/>
<system-out>[ RUN      ] Replay.Kitchen
/x/replay_test.cpp:12: Skipped
needs kitchen-400 in the folder
named by GEOFLOW_DATA

[  SKIPPED ] Replay.Kitchen (0 ms)
</system-out></testcase>"""
PASSED = '<testcase name="A.B" status="run"><system-out/></testcase>'
FAILED = '<testcase name="C.D" status="fail"><failure message=""/><system-out>boom</system-out></testcase>'


class Summary(unittest.TestCase):
    def summarise(self, *runs):
        with tempfile.TemporaryDirectory() as folder:
            paths = []
            for number, cases in enumerate(runs):
                path = Path(folder) / f"{number}.xml"
                if cases is not None:
                    path.write_text(f"<testsuite>{cases}</testsuite>")
                paths.append(str(path))
            out = io.StringIO()
            return test_summary.summarise(paths, out), out.getvalue().splitlines()

    def test_counts_over_all_runs(self):
        code, lines = self.summarise(PASSED, PASSED + SKIPPED)
        self.assertEqual(code, 0)
        self.assertEqual(lines[-1], "2 passed, 0 failed, 1 skipped")

    def test_a_skipped_test_is_named_with_what_it_lacks(self):
        _, lines = self.summarise(SKIPPED)
        self.assertEqual(lines[0], "skipped: Replay.Kitchen: needs kitchen-400 in the folder named by GEOFLOW_DATA")

    def test_a_failed_test_is_named_and_fails_the_run(self):
        code, lines = self.summarise(PASSED + FAILED)
        self.assertEqual((code, lines), (1, ["failed: C.D", "    boom", "1 passed, 1 failed, 0 skipped"]))

    def test_of_a_long_output_the_lines_that_say_failure_are_shown(self):
        said = "\n".join([f"ok   {i}" for i in range(40)] + ["FAIL it is drawn", "ok   the rest"])
        _, lines = self.summarise(FAILED.replace("boom", said))
        self.assertEqual(lines[:2], ["failed: C.D", "    FAIL it is drawn"])

    def test_a_run_without_results_fails(self):
        self.assertEqual(self.summarise(PASSED, None)[0], 1)
        self.assertEqual(self.summarise("")[0], 1)
