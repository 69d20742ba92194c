#pragma once

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/tools/emulator/byte_writer.hpp"

#include "src/image_view.hpp"
#include "src/stream_table.hpp"

namespace geoflow::emulator {

/// Lays out an image of a world as a D435i sends it.
class ImagePacker {
 public:
  /// `source`: of the images to come.
  ImagePacker(const CameraIntrinsics& source, Packing packing, const FrameSize& size);

  /// Appends the image. kDepth takes `depth`, all others `color`; the pairs of grays take both, as
  /// the right image is the left one seen from the other imager, `baseline_m` to the right, by what
  /// depth says (`depth_unit_m`). Frames may be empty (pixels are 0) where the packing does not
  /// need them; those there are have the source's size.
  void pack(const ColorFrame& color, const DepthFrame& depth, double depth_unit_m,
            ByteWriter& to) const;

 private:
  Packing packing_;
  double fx_px_;  ///< of the view
  PixelMap map_;
};

/// Between the two imagers [m] (D400 datasheet).
inline constexpr double kBaselineM = 0.05;

}  // namespace geoflow::emulator
