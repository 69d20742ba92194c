"""tools/check/faults.py on small invented tables."""
import tempfile
import unittest
from pathlib import Path

import faults


class FaultsTest(unittest.TestCase):
    def test_tests_are_found_by_their_sources(self):
        with tempfile.TemporaryDirectory() as folder:
            top = Path(folder)
            for name, text in {"tests/a_test.cpp": "TEST_F(One, Works) {\n", "tests/hil/can_guest.py": "",
                               "tests/fuzz/bag_fuzz.cpp": ""}.items():
                (top / name).parent.mkdir(parents=True, exist_ok=True)
                (top / name).write_text(text)
            self.assertEqual(faults.tests_there(top), {"One.Works", "hil.can", "fuzz.bag"})

    def test_a_row_names_tests_that_are_there_or_what_is_missing(self):
        rows = [{"what": "a", "tests": ["One.Works", "Two.*"]}, {"what": "b", "missing": "all"}, {"what": "c"}]
        found = list(faults.problems(rows, {"One.Works"}))
        self.assertEqual(len(found), 2)
        self.assertIn("Two.*", found[0])
        self.assertIn("'c'", found[1])

    def test_outcomes_are_of_the_rows_own_tests(self):
        states = {"One.Works": "run", "Kinds/One.Fails/2": "fail", "OneMore.Works": "fail", "Two.Works": "notrun"}
        self.assertEqual(faults.outcome({"tests": ["One.Works"]}, states), "1 passed")
        self.assertEqual(faults.outcome({"tests": ["One.*"]}, states), "**1 of 2 failed**")
        self.assertEqual(faults.outcome({"tests": ["One.Works", "Two.Works"]}, states), "1 passed, 1 skipped")
        self.assertEqual(faults.outcome({"missing": "all"}, states), "-")

    def test_the_page_has_a_line_for_each_row(self):
        rows = [{"what": "a", "expected": "b", "tests": ["One.Works"], "missing": "c"}]
        self.assertTrue(faults.page(rows).endswith("| a | b | `One.Works`; **not injected**: c |\n"))
        self.assertTrue(faults.page(rows, ["1 passed"]).endswith("c | 1 passed |\n"))


if __name__ == "__main__":
    unittest.main()
