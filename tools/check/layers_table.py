"""Who may know whom: the table of docs/architecture.md in the form that layers.py reads."""
from dataclasses import dataclass

# part: the parts that it may include and link
PARTS = {
    "hal": {"hal"},
    "timesync": {"timesync", "hal"},
    "drivers": {"drivers", "hal"},
    "slam": {"slam", "hal"},
    "calibration": {"calibration", "hal"},
    "daemon": {"daemon", "slam", "drivers", "timesync", "hal"},
    "tools": {"tools", "daemon", "calibration", "slam", "drivers", "timesync", "hal"},
    "clients": {"clients", "daemon"},  # of the daemon the protocol's header alone
    "tests": {"tests", "clients", "tools", "daemon", "calibration", "slam", "drivers", "timesync", "hal"},
}

# Parts to which time is an argument.
CLOCKLESS = {"slam", "timesync", "calibration"}

# Benchmarks measure the insides of other parts, and so, like tests, may see their private headers.
MEASURING_ROOMS = ("tools/bench",)


@dataclass(frozen=True)
class Library:
    """A third-party library: its headers (regex), its CMake targets, and the folders or files that may use it."""

    name: str
    headers: str
    targets: tuple
    rooms: tuple


EVERYWHERE = ("hal", "timesync", "drivers", "slam", "calibration", "daemon", "tools")

LIBRARIES = (
    Library("Eigen", r"(unsupported/)?Eigen/", ("Eigen3::Eigen",), EVERYWHERE),
    Library("expected", r"tl/", ("tl::expected",), EVERYWHERE),
    Library("fmt", r"fmt/", ("fmt::fmt",), EVERYWHERE),
    Library("OpenCV", r"opencv2/", ("opencv_core", "opencv_imgproc", "opencv_imgcodecs", "opencv_video", "opencv_calib3d",
                                    "opencv_features2d"), ("drivers/replay", "slam/vision", "tools/simulator/recording")),
    Library("Ceres", r"ceres/", ("Ceres::ceres",), ("slam/optimisation", "tools/calibrate")),
    Library("TBB", r"(oneapi/)?tbb/", ("TBB::tbb",), ("slam", "tools/bench", "tools/simulator/camera")),
    Library("Embree", r"embree3/", ("embree",), ("tools/simulator/camera",)),
    Library("nanoflann", r"nanoflann\.hpp", ("nanoflann::nanoflann",), ("slam/cloud", "slam/map")),
    Library("Boost", r"boost/", ("Boost::headers",), ("timesync",)),
    Library("SQLite", r"sqlite3\.h", ("PkgConfig::SQLITE3", "SQLite::SQLite3"), ("drivers/replay",)),
    Library("zstd", r"zstd\.h", ("PkgConfig::ZSTD",), ("drivers/replay",)),
    Library("lz4", r"lz4(frame)?\.h", ("PkgConfig::LZ4",), ("drivers/replay/bag",)),
    Library("zlib", r"z(lib|conf)\.h", ("ZLIB::ZLIB",),
            ("drivers/replay/bag", "drivers/replay/scannet", "drivers/d435i/monitor", "slam/storage")),
    Library("yaml-cpp", r"yaml-cpp/", ("yaml-cpp",), ("drivers/replay",)),
    Library("toml++", r"toml\+\+/", ("tomlplusplus::tomlplusplus",), ("daemon/config", "drivers/replay", "tools/calibrate")),
    Library("CLI11", r"CLI/", ("CLI11::CLI11",), ("daemon/src/command_line.cpp", "tools")),
    Library("nlohmann-json", r"nlohmann/", ("nlohmann_json::nlohmann_json",), ("daemon", "tools")),
    Library("cairo", r"cairo", ("PkgConfig::CAIRO",), ("tools/plot",)),
    Library("libmicrohttpd", r"microhttpd\.h", ("PkgConfig::MICROHTTPD",), ("tools/view",)),
    Library("systemd", r"systemd/", ("PkgConfig::SYSTEMD",), ("daemon/service",)),
    Library("udev", r"libudev\.h", ("PkgConfig::UDEV",), ("drivers/usb",)),
    Library("libusb", r"libusb", ("PkgConfig::LIBUSB",), ("drivers/usb",)),
    Library("V4L2", r"linux/(videodev2|uvcvideo|media)\.h", (), ("drivers/v4l2",)),
    Library("SocketCAN", r"linux/can", (), ("drivers/can",)),
    Library("OpenNI2", r"(Driver/)?(OpenNI|Oni[A-Za-z]+)\.h", ("PkgConfig::OPENNI2",), ("drivers/openni2",)),
    Library("DDS", r"dds/|RosMessages\.h", ("CycloneDDS::ddsc", "CycloneDDS-CXX::ddscxx"), ("drivers/dds",)),
    # Only for tests, as tools or as what to compare with.
    Library("GoogleTest", r"(gtest|gmock)/",
            ("GTest::gtest", "GTest::gmock", "GTest::gtest_main", "GTest::gmock_main"), ()),
    Library("RapidCheck", r"rapidcheck", ("rapidcheck", "rapidcheck_gtest"), ()),
    Library("Google Benchmark", r"benchmark/", ("benchmark::benchmark", "benchmark::benchmark_main"), ()),
    Library("PCL", r"pcl/", ("${PCL_LIBRARIES}", "pcl_common", "pcl_registration", "pcl_filters"), ("tools/bench",)),
    Library("Clang", r"(clang|llvm)/", (), ("tools/check",)),
    Library("Fast-CDR", r"fastcdr/", ("fastcdr",), ()),
    Library("threads", r"\0", ("Threads::Threads",), EVERYWHERE),
)

# The standard library, POSIX and the kernel's general interfaces.
STANDARD = (r"^([a-z_]+|(sys|arpa|netinet|linux|net)/[a-z_]+\.h|[a-z_]*(unistd|fcntl|signal|poll|dirent|pthread|sched|"
            r"stdlib|string|stdio|stdint|stddef|stdbool|errno|endian|inttypes|time|math|getopt|termios|dlfcn|cxxabi|spawn|"
            r"stdarg|grp|pwd|sysexits|locale|malloc|float|limits|assert|ctype)\.h)$")

THREAD_HEADERS = {"thread", "mutex", "condition_variable", "shared_mutex", "semaphore", "barrier", "latch", "future",
                  "pthread.h"}

# The only files outside tests that make a thread or take a lock, each for the reason given.
THREAD_FILES = (
    "hal/src/log.cpp",  # the sink is called under a lock
    "drivers/can/legs_source.cpp",  # reads the legs' bus on a thread of its own
    "drivers/can/legs_source.hpp",
    "drivers/dds/robot_source.cpp",  # reads the robot's messages on a thread of its own
    "drivers/dds/robot_source.hpp",
    "drivers/d435i/device/device.cpp",  # tells other threads how the camera is, and waits interruptibly while it is away
    "drivers/openni2/camera.cpp",  # waits interruptibly while the camera is away
    "drivers/openni2/module/camera_feed.cpp",  # keeps the camera streaming for a program that has no thread for it
    "drivers/openni2/module/camera_feed.hpp",
    "drivers/replay/bag/writer.cpp",  # samples are written from the threads that bring them
    "timesync/include/geoflow/timesync/packet_queue.hpp",  # gives up the oldest packet but for its samples
    "timesync/src/packet_queue.cpp",
    "drivers/port.hpp",  # a port's sink is started and stopped while the recording plays
    "drivers/v4l2/iio_sensor.cpp",  # the kernel turns a sensor on for up to two seconds
    "drivers/v4l2/iio_sensor.hpp",
    "drivers/replay/prefetcher.cpp",  # decodes images ahead of the replay
    "drivers/replay/prefetcher.hpp",
    "drivers/replay/recorded_streams.cpp",  # paced replay waits for the next stamp, interruptibly
    "drivers/dds/session.cpp",  # what a process has joined is one table for all its threads
    "daemon/bus/ros_bus.cpp",  # tells ROS 2 machines, where DDS may block, on a thread of its own
    "daemon/bus/ros_bus.hpp",
    "daemon/pipeline/map_worker.cpp",  # the thread of one worker on the map
    "daemon/pipeline/map_worker.hpp",
    "daemon/pipeline/pipeline.cpp",  # makes the live pipeline's threads
    "daemon/map/map_keeper.cpp",  # makes the thread that writes the map
    "daemon/map/map_keeper.hpp",
    "daemon/src/opener.cpp",  # makes the thread that waits for a camera
    "daemon/src/opener.hpp",
    "daemon/src/signal_watch.cpp",  # blocks signals for all threads
    "daemon/src/worker.cpp",  # makes the thread of a lock-step run
    "daemon/src/worker.hpp",
    "tools/bench/client_load.cpp",  # clients go on while the daemon is waited for
    "tools/bench/client_load.hpp",
    "tools/bench/clients_benchmark.cpp",  # asks the daemon how it is while its end is waited for
    "tools/record/live_recorder.cpp",  # the source delivers on a thread of its own while this one writes
    "tools/view/live_state.cpp",  # pages wait, on threads of their library, for what the follower puts
    "tools/view/live_state.hpp",
    "tools/view/map_scene.cpp",  # a page's thread reads the map that the follower names
    "tools/view/map_scene.hpp",
    "tools/record/sample_queue.hpp",  # between the threads that bring samples and the one that writes them
)
