#include "geoflow/tools/verb.hpp"

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

#include "geoflow/hal/geometry.hpp"
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

  /// A csv of EuRoC's form at 200 Hz.
  class Csv {
   public:
    explicit Csv(const std::string& path) : file_{path} {
      file_ << "#timestamp [ns],w_x,w_y,w_z,a_x,a_y,a_z\n";
    }
    /// An IMU that turns at `rate_radps` about x with `accel` for so long.
    void say(double duration_s, const Vector3d& accel, double rate_radps) {
      constexpr std::int64_t kPeriodNs = 5'000'000;
      const auto end = count_ + static_cast<std::int64_t>(duration_s * 200);
      for (; count_ < end; ++count_) {
        file_ << 1'000'000'000 + count_ * kPeriodNs << ',' << rate_radps + 0.003 * normal_(random_);
        file_ << ',' << 0.003 * normal_(random_) << ',' << 0.003 * normal_(random_);
        for (const double value : accel) {
          file_ << ',' << value + 0.02 * normal_(random_);
        }
        file_ << '\n';
      }
    }

   private:
    std::ofstream file_;
    std::mt19937_64 random_{1};
    std::normal_distribution<double> normal_;
    std::int64_t count_ = 0;
  };

  /// Of an IMU that lies still.
  [[nodiscard]] std::string lying(double duration_s) const {
    const std::string path = file("imu.csv");
    Csv{path}.say(duration_s, {0, 9.8, 0}, 0);
    return path;
  }

  /// Of one that is laid down on its sides, edges and corners, and whose x axis says 2 % too much.
  [[nodiscard]] std::string laid_down() const {
    const std::string path = file("poses.csv");
    Csv csv{path};
    for (int side = 0; side < 27; ++side) {
      const Vector3d up{side % 3 - 1.0, side / 3 % 3 - 1.0, side / 9 - 1.0};
      if (up.norm() > 0) {
        const Vector3d accel = 9.80665 * up.normalized();
        csv.say(2, {1.02 * accel.x(), accel.y(), accel.z()}, 0);
        csv.say(0.5, {0, 0, 5}, 1);
      }
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

TEST_F(CalibrateTest, FindsAScaleThatIsWrong) {
  const std::string output = file("out");
  ASSERT_EQ(run({"imu", laid_down(), "-o", output}), 0) << err_;
  EXPECT_THAT(out_, HasSubstr("It lies still 26 times"));
  EXPECT_THAT(out_, HasSubstr("PASS  accel.scale_error_x"));
  EXPECT_THAT(read(output + "/imu.toml"), HasSubstr("accel_scale_error_x = -0.019"));
  EXPECT_THAT(read(output + "/imu-1.png"), HasSubstr("PNG"));
}

TEST_F(CalibrateTest, RefusesPosesThatAreTooFew) {
  EXPECT_EQ(run({"imu", lying(5)}), 3);
  EXPECT_THAT(err_, HasSubstr("imu.csv: it lies still 1 times"));
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
