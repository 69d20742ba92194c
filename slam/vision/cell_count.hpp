#pragma once

#include <opencv2/core.hpp>

namespace geoflow::slam {

/// Counts what has been taken of each cell of a grid over an image. Value type; thread-compatible.
class CellCount {
 public:
  /// Square cells of `cell_px`, each with room for `most`.
  CellCount(const cv::Size& image, int cell_px, int most)
      : cell_px_{cell_px},
        most_{most},
        count_(image.height / cell_px + 1, image.width / cell_px + 1, 0) {}

  /// Whether there is room in the cell of a pixel.
  [[nodiscard]] bool has_room(double x, double y) const {
    return count_(row_or_column(y), row_or_column(x)) < most_;
  }
  /// The same; takes it.
  bool take(double x, double y) {
    const bool room = has_room(x, y);
    count_(row_or_column(y), row_or_column(x)) += room ? 1 : 0;
    return room;
  }

 private:
  [[nodiscard]] int row_or_column(double pixel) const { return static_cast<int>(pixel) / cell_px_; }

  int cell_px_;
  int most_;
  cv::Mat1i count_;
};

}  // namespace geoflow::slam
