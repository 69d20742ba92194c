#include "d435i/device/diagnosis.hpp"

#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/drivers/d435i.hpp"

namespace geoflow::drivers::d435i::tests {
namespace {

using Grade = D435iFinding::Grade;

SeenNode node(int number, bool metadata) {
  return {.node = {.path = "/dev/video" + std::to_string(number), .number = number},
          .accessible = true,
          .metadata = metadata,
          .full_metadata = metadata};
}

/// A camera to which nothing is wanting.
SeenCamera healthy() {
  return {.camera = {.place = "2-1",
                     .serial = "850123050307",
                     .speed_mbps = 5000,
                     .usb_node = "/dev/bus/usb/002/005",
                     .iio = {{.sysfs = {}, .path = {}, .name = "accel_3d"},
                             {.sysfs = {}, .path = {}, .name = "gyro_3d"}}},
          .usb_accessible = true,
          .nodes = {node(0, false), node(1, true), node(4, false), node(5, true)}};
}

/// The remedies of findings of a grade.
std::vector<std::string> remedies(const SeenCamera& camera, Grade grade) {
  std::vector<std::string> found;
  for (const D435iFinding& finding : diagnose({.cameras = {camera}})) {
    if (finding.grade == grade) {
      EXPECT_FALSE(finding.what.empty());
      found.push_back(finding.remedy);
    }
  }
  return found;
}

void expect_one(const SeenCamera& camera, Grade grade, const std::string& word) {
  const auto found = remedies(camera, grade);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_NE(found.front().find(word), std::string::npos) << found.front();
}

TEST(Diagnosis, OfAHealthyCameraIsGood) {
  EXPECT_TRUE(remedies(healthy(), Grade::kProblem).empty());
  EXPECT_TRUE(remedies(healthy(), Grade::kNote).empty());
  EXPECT_EQ(remedies(healthy(), Grade::kGood).size(), 5U);
}

TEST(Diagnosis, WithoutACameraSaysSo) {
  const auto findings = diagnose({});
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings[0].grade, Grade::kProblem);
  EXPECT_NE(findings[0].what.find("no D435i"), std::string::npos);
  EXPECT_NE(diagnose({.in_recovery = true})[0].what.find("recovery"), std::string::npos);
}

TEST(Diagnosis, NamesEachLackWithItsRemedy) {
  SeenCamera camera = healthy();
  camera.camera.speed_mbps = 480;
  expect_one(camera, Grade::kProblem, "USB 3 cable");
  camera = healthy();
  camera.usb_accessible = false;
  expect_one(camera, Grade::kProblem, "60-geoflow.rules");
  camera = healthy();
  camera.nodes.clear();
  expect_one(camera, Grade::kProblem, "modprobe uvcvideo");
  camera = healthy();
  camera.nodes[2].accessible = false;
  expect_one(camera, Grade::kProblem, "plugdev");
  camera = healthy();
  camera.camera.iio.pop_back();
  expect_one(camera, Grade::kProblem, "hid-sensor-hub");
  camera = healthy();
  camera.iio_writable = false;
  expect_one(camera, Grade::kProblem, "60-geoflow.rules");
}

TEST(Diagnosis, MetadataInPartIsANote) {
  SeenCamera camera = healthy();
  for (SeenNode& one : camera.nodes) {
    one.full_metadata = false;
  }
  expect_one(camera, Grade::kNote, "new_id");
  for (SeenNode& one : camera.nodes) {
    one.metadata = false;
  }
  expect_one(camera, Grade::kNote, "libusb");
}

}  // namespace
}  // namespace geoflow::drivers::d435i::tests
