#include "geoflow/tools/verb.hpp"

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <random>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/support/data.hpp"

#include "tools/verb_fixture.hpp"

namespace geoflow::tools {

// NOLINTNEXTLINE(misc-use-internal-linkage): the verb's library defines it
std::unique_ptr<Verb> make_calibrate_verb();

namespace {

using testing::HasSubstr;
using testing::Not;

std::string read(const std::filesystem::path& path) {
  std::ifstream file{path, std::ios::binary};
  return {std::istreambuf_iterator<char>{file}, {}};
}

class CalibrateTest : public tests::VerbTest {
 protected:
  CalibrateTest() : VerbTest{make_calibrate_verb} {}

  /// A csv of EuRoC's form of an IMU that lies still, at 200 Hz.
  [[nodiscard]] std::string lying(double duration_s) const {
    constexpr std::int64_t kPeriodNs = 5'000'000;
    std::mt19937_64 random{1};
    std::normal_distribution<double> normal;
    const std::string path = file("imu.csv");
    std::ofstream csv{path};
    csv << "#timestamp [ns],w_x,w_y,w_z,a_x,a_y,a_z\n";
    const auto count = static_cast<std::int64_t>(duration_s * 200);
    for (std::int64_t i = 0; i < count; ++i) {
      csv << 1'000'000'000 + i * kPeriodNs;
      for (int axis = 0; axis < 3; ++axis) {
        csv << ',' << 0.003 * normal(random);
      }
      csv << ',' << 0.02 * normal(random) << ',' << 9.8 + 0.02 * normal(random) << ','
          << 0.02 * normal(random) << '\n';
    }
    return path;
  }
};

TEST_F(CalibrateTest, WritesResultPageAndFigure) {
  const std::string output = file("out");
  ASSERT_EQ(run({"imu-noise", lying(70), "-o", output}), 0) << err_;
  EXPECT_THAT(out_, HasSubstr("PASS  accel.white_noise"));
  EXPECT_THAT(out_, HasSubstr("WARN  gyro.random_walk"));
  const std::string toml = read(output + "/imu-noise.toml");
  EXPECT_THAT(toml, HasSubstr("what = 'imu-noise'"));
  EXPECT_THAT(toml, HasSubstr("accel_noise_density = 0.00141"));
  EXPECT_THAT(toml, HasSubstr("recording_hash = '"));
  // What is not determined is not for the estimator.
  EXPECT_THAT(toml, Not(HasSubstr("accel_random_walk")));
  EXPECT_THAT(read(output + "/imu-noise.html"), HasSubstr("imu-noise-1.png"));
  EXPECT_THAT(read(output + "/imu-noise-1.png"), HasSubstr("PNG"));
  // Nothing half written is left.
  for (const auto& entry : std::filesystem::directory_iterator{output}) {
    EXPECT_THAT(entry.path().filename().string(), testing::StartsWith("imu-noise"));
  }
}

TEST_F(CalibrateTest, SaysFindingsAsJson) {
  ASSERT_EQ(run({"imu-noise", lying(70), "--json"}), 0) << err_;
  const auto object = nlohmann::json::parse(out_);
  EXPECT_EQ(object["what"], "imu-noise");
  EXPECT_EQ(object["verdict"], "WARN");
  EXPECT_EQ(object["findings"].size(), 24);
  EXPECT_EQ(object["findings"][0]["name"], "accel.white_noise");
  EXPECT_TRUE(object["findings"][2]["sigma"].is_null());
}

TEST_F(CalibrateTest, RefusesWhatIsTooShortByName) {
  const std::string csv = lying(5);
  EXPECT_EQ(run({"imu-noise", csv, "-o", file("out")}), 3);
  EXPECT_THAT(err_, HasSubstr("imu.csv: too short"));
  EXPECT_FALSE(std::filesystem::exists(file("out")));
}

TEST_F(CalibrateTest, RefusesARecordingWithoutAnImu) {
  GEOFLOW_DATA_OR_SKIP(kitchen, "kitchen-400");
  EXPECT_EQ(run({"imu-noise", kitchen.string()}), 3);
  EXPECT_THAT(err_, HasSubstr("has no inertial samples"));
}

TEST_F(CalibrateTest, RefusesARealFlight) {
  GEOFLOW_DATA_OR_SKIP(flight, "euroc-v102");
  EXPECT_EQ(run({"imu-noise", flight.string()}), 3);
  EXPECT_THAT(err_, HasSubstr("it moves: the longest stretch of standing still is"));
}

}  // namespace
}  // namespace geoflow::tools
