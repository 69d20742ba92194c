#pragma once

#include <memory>
#include <optional>
#include <string_view>

#include <OniEnums.h>
#include <OpenNI.h>

#include "geoflow/drivers/openni2_camera.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/result.hpp"

#include "openni2/pixels.hpp"

namespace geoflow::drivers::openni2 {

/// What OpenNI's pixels are; none for those that are no use.
[[nodiscard]] std::optional<SourcePixel> source_pixel(openni::PixelFormat format);

/// OpenNI itself, which counts who uses it. It must outlive all devices.
class Library {
 public:
  Library();
  Library(const Library&) = delete;
  Library& operator=(const Library&) = delete;
  ~Library();

  /// kSystem where it could not begin.
  [[nodiscard]] Result<void> status() const;

 private:
  openni::Status status_;
};

/// A device with its two streams, from its opening to its loss. Thread-bound.
class OpenDevice {
 public:
  /// Opens it and chooses the modes; a file is in the modes that it has. See open_openni2_camera()
  /// for the errors.
  [[nodiscard]] static Result<std::unique_ptr<OpenDevice>> open(const OpenNi2Options& options);

  OpenDevice() = default;
  OpenDevice(const OpenDevice&) = delete;
  OpenDevice& operator=(const OpenDevice&) = delete;
  ~OpenDevice();

  [[nodiscard]] Result<void> start();
  /// The next frame of either; which one, its sensor type says. None where none comes within 50 ms:
  /// so long may a stop have to wait.
  [[nodiscard]] Result<std::optional<openni::VideoFrameRef>> next();
  /// Whether it is a file.
  [[nodiscard]] bool is_file() const { return device_.isFile(); }
  /// Whether it is a file whose last frames next() has given.
  [[nodiscard]] bool at_end() const;

  /// By the colour camera's fields of view: no distortion, the centre in the middle.
  [[nodiscard]] Calibration calibration() const;

 private:
  /// OpenNI's player goes through its streams in a thread of its own, without a lock, so that one
  /// that is destroyed meanwhile ends the process (PlayerDevice::MainLoop of OpenNI 2.2; a crash in
  /// 7 of 100 runs). Where none is started it looks at them every 10 ms only.
  void pause_player();
  /// One sensor's stream; of a file also how far it is.
  struct Stream {
    openni::VideoStream video{};
    int newest_index = 0;  ///< of the frames that were given
    int frames = 0;        ///< in the file
  };

  [[nodiscard]] Result<void> create(Stream& stream, openni::SensorType type, std::string_view name,
                                    const OpenNi2Options& options);
  void align();

  openni::Device device_;
  Stream depth_;
  Stream color_;
};

}  // namespace geoflow::drivers::openni2
