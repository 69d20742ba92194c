import unittest

import layers
import source


def findings(path, text, others=()):
    return [finding.message for finding in layers.check(source.Project({path: text, **dict.fromkeys(others, "")}))]


class Includes(unittest.TestCase):
    def test_parts(self):
        self.assertEqual(findings("slam/a.cpp", '#include "geoflow/hal/time.hpp"\n'), [])
        self.assertEqual(findings("slam/a.cpp", '#include "geoflow/timesync/ring.hpp"\n'), ["slam may not include timesync"])
        self.assertEqual(findings("hal/a.hpp", '#include "geoflow/slam/core.hpp"\n'), ["hal may not include slam"])
        self.assertEqual(findings("daemon/a.cpp", '#include "geoflow/slam/core.hpp"\n'), [])
        self.assertEqual(len(findings("slam/a.cpp", '#include "tests/support/data.hpp"\n')), 1)

    def test_private_headers_belong_to_their_part(self):
        headers = ("drivers/replay/reader.hpp",)
        self.assertEqual(findings("drivers/replay/a.cpp", '#include "replay/reader.hpp"\n', headers), [])
        self.assertEqual(len(findings("daemon/a.cpp", '#include "replay/reader.hpp"\n', headers)), 1)
        self.assertEqual(len(findings("daemon/a.cpp", '#include "../drivers/replay/reader.hpp"\n', headers)), 1)
        self.assertEqual(findings("tests/drivers/a.cpp", '#include "replay/reader.hpp"\n', headers), [])

    def test_libraries_stay_in_their_rooms(self):
        self.assertEqual(findings("slam/vision/a.cpp", "#include <opencv2/core.hpp>\n"), [])
        self.assertEqual(len(findings("slam/cloud/a.cpp", "#include <opencv2/core.hpp>\n")), 1)
        self.assertEqual(len(findings("slam/visionary/a.cpp", "#include <opencv2/core.hpp>\n")), 1)
        self.assertEqual(len(findings("hal/a.cpp", "#include <ceres/ceres.h>\n")), 1)
        self.assertEqual(len(findings("slam/cloud/a.cpp", "#include <pcl/point_cloud.h>\n")), 1)
        self.assertEqual(findings("tests/bench/a.cpp", "#include <pcl/point_cloud.h>\n"), [])
        self.assertEqual(findings("slam/math/a.cpp", "#include <Eigen/Core>\n#include <vector>\n#include <sys/mman.h>\n"), [])

    def test_an_unknown_library_is_refused(self):
        self.assertEqual(findings("slam/a.cpp", "#include <sophus/se3.hpp>\n"),
                         ["<sophus/se3.hpp> is of no library in layers_table.py"])

    def test_threads_and_streams(self):
        self.assertEqual(len(findings("slam/a.cpp", "#include <mutex>\n#include <thread>\n")), 2)
        self.assertEqual(findings("hal/src/log.cpp", "#include <mutex>\n"), [])
        self.assertEqual(findings("tests/a.cpp", "#include <thread>\n#include <iostream>\n"), [])
        self.assertEqual(len(findings("daemon/a.cpp", "#include <iostream>\n")), 1)
        self.assertEqual(findings("tools/a.cpp", "#include <iostream>\n"), [])

    def test_the_estimator_reads_no_clock(self):
        self.assertEqual(len(findings("slam/a.cpp", "auto t = HostClock::now();\n")), 1)
        self.assertEqual(len(findings("timesync/a.cpp", "auto t = std::chrono::steady_clock::now();\n")), 1)
        self.assertEqual(findings("slam/a.cpp", "// not HostClock::now()\n"), [])
        self.assertEqual(findings("daemon/a.cpp", "auto t = HostClock::now();\n"), [])


class Links(unittest.TestCase):
    def test_edges_between_parts(self):
        self.assertEqual(findings("slam/CMakeLists.txt", "geoflow_part(slam SOURCES a.cpp DEPENDS geoflow::hal)"), [])
        self.assertEqual(findings("slam/CMakeLists.txt", "geoflow_part(slam SOURCES a.cpp DEPENDS geoflow::drivers)"),
                         ["slam may not link drivers"])
        self.assertEqual(findings("timesync/CMakeLists.txt", "target_link_libraries(x PRIVATE geoflow_slam)"),
                         ["timesync may not link slam"])

    def test_edges_to_libraries(self):
        self.assertEqual(findings("slam/CMakeLists.txt", "geoflow_part(slam DEPENDS geoflow::hal PRIVATE_DEPENDS Ceres::ceres)"), [])
        self.assertEqual(findings("timesync/CMakeLists.txt", "geoflow_part(timesync\n  PRIVATE_DEPENDS Ceres::ceres)"),
                         ["timesync may not link Ceres"])
        self.assertEqual(findings("hal/CMakeLists.txt", "target_link_libraries(geoflow_hal PUBLIC Sophus::Sophus)"),
                         ["Sophus::Sophus is of no library in layers_table.py"])
        self.assertEqual(findings("hal/CMakeLists.txt", "# target_link_libraries(geoflow_hal PUBLIC Sophus::Sophus)"), [])
