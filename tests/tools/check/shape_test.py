import unittest

import shape
import source


def findings(files):
    return sorted(shape.check(source.Project(files)))


def messages(code, path="slam/a.cpp"):
    return [finding.message for finding in findings({path: code, "slam/CMakeLists.txt": "a.cpp",
                                                     "tests/CMakeLists.txt": "a.cpp"})]


def numbered(count, first=0):
    return "".join(f"call_{i}();\n" for i in range(first, first + count))


class Sizes(unittest.TestCase):
    def test_a_source_has_at_most_400_lines(self):
        self.assertEqual(messages(numbered(400)), [])
        self.assertEqual(len(messages(numbered(401))), 1)

    def test_documents_may_be_longer_but_not_huge(self):
        self.assertEqual(findings({"docs/a.md": "line\n" * 500}), [])
        self.assertEqual(len(findings({"docs/a.md": "x" * (256 * 1024 + 1)})), 1)


class Words(unittest.TestCase):
    def test_ownership(self):
        self.assertEqual(len(messages("auto* x = new X;")), 1)
        self.assertEqual(len(messages("consume(new (place) X{});")), 1)
        self.assertEqual(len(messages("delete x;")), 1)
        self.assertEqual(messages("X(const X&) = delete;  // a new copy"), [])
        self.assertEqual(messages("const char* s = \"new X\"; int newest = renew;"), [])

    def test_a_private_constructor_is_reached_through_an_owner(self):
        self.assertEqual(messages("std::unique_ptr<X> x{new X{1}};"), [])
        self.assertEqual(messages("return std::unique_ptr<X>{\n    new X};"), [])
        self.assertEqual(len(messages("std::shared_ptr<X> x = make(new X{1});")), 1)

    def test_sleep_only_in_tests(self):
        code = "std::this_thread::sleep_for(1s);"
        self.assertEqual(len(messages(code)), 1)
        self.assertEqual(messages(code, "tests/a.cpp"), [])
        self.assertEqual(len(messages("usleep(100);")), 1)

    def test_notes_to_come_back(self):
        self.assertEqual(len(messages("// TO" + "DO: later")), 1)


class Built(unittest.TestCase):
    def test_every_source_is_in_a_cmake_list(self):
        lists = {"tests/hal/CMakeLists.txt": "geoflow_test(hal_test SOURCES a_test.cpp sub/b_test.cpp)"}
        self.assertEqual(findings({**lists, "tests/hal/a_test.cpp": "", "tests/hal/sub/b_test.cpp": ""}), [])
        lost = findings({**lists, "tests/hal/aa_test.cpp": "", "tests/hal/b_test.cpp": ""})
        self.assertEqual([finding.path for finding in lost], ["tests/hal/aa_test.cpp", "tests/hal/b_test.cpp"])

    def test_a_pattern_names_too(self):
        lists = {"tests/fuzz/CMakeLists.txt": 'file(GLOB sources "${CMAKE_CURRENT_SOURCE_DIR}/*_fuzz.cpp")'}
        lost = findings({**lists, "tests/fuzz/a_fuzz.cpp": "", "tests/fuzz/a.cpp": ""})
        self.assertEqual([finding.path for finding in lost], ["tests/fuzz/a.cpp"])


class Runs(unittest.TestCase):
    lists = {"slam/CMakeLists.txt": "a.cpp b.cpp"}

    def runs(self, a, b):
        return [(finding.path, finding.line, finding.message)
                for finding in findings({**self.lists, "slam/a.cpp": a, "slam/b.cpp": b})]

    def test_eleven_lines_may_stand_twice(self):
        self.assertEqual(self.runs(numbered(11), "first();\n" + numbered(11)), [])

    def test_a_run_is_found_once_and_at_full_length(self):
        self.assertEqual(self.runs(numbered(20), "first();\n" + numbered(20)),
                         [("slam/b.cpp", 2, "20 lines that also stand at slam/a.cpp:1")])

    def test_blanks_comments_and_braces_do_not_hide_a_run(self):
        spaced = "".join(f"  call_{i}();  // {i}\n\n}}\n" for i in range(12))
        self.assertEqual(len(self.runs(numbered(12), spaced)), 1)

    def test_includes_are_no_run(self):
        includes = "".join(f"#include <header_{i}>\n" for i in range(20))
        self.assertEqual(self.runs(includes, includes), [])
