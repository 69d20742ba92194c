#pragma once

#include <filesystem>

namespace geoflow::tests {

/// What write_synthetic_recording() makes: a camera that slides along x before a textured wall with
/// a step in it.
struct SyntheticRecording {
  int frames = 30;
  int width = 320;
  int height = 240;
  double focal_px = 260;
  double rate_hz = 30;
  int shift_px = 4;     ///< of the wall's image, from frame to frame
  double wall_m = 1.3;  ///< the camera moves shift_px * wall_m / focal_px a frame

  [[nodiscard]] double step_m() const { return shift_px * wall_m / focal_px; }
};

/// Writes it as a TUM RGB-D directory with a Kalibr camchain: PNG images, stamps from 1000 s on.
void write_synthetic_recording(const std::filesystem::path& directory,
                               const SyntheticRecording& recording);

}  // namespace geoflow::tests
