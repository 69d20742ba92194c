#pragma once

#include <cstdint>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/evaluate/association.hpp"

namespace geoflow::tools {

/// How the estimate is laid over the reference before errors are taken.
enum class Alignment : std::uint8_t {
  kNone,    ///< as it is
  kOrigin,  ///< so that the first pair's poses are equal
  kSe3,     ///< the rotation and translation with the least squared position error
  kSim3,    ///< the same and a scale, for estimators that cannot know it
};

/// "none", "origin", "se3" or "sim3".
[[nodiscard]] const char* to_string(Alignment alignment) noexcept;

/// A point in the estimate's frame goes to `T_ref_est * (scale * p)`, a rotation R to `R_ref_est *
/// R`.
struct Similarity {
  double scale = 1.0;
  SE3 T_ref_est{};

  [[nodiscard]] SE3 operator*(const SE3& pose) const noexcept {
    return T_ref_est * SE3{pose.rotation(), scale * pose.translation()};
  }
};

/// The alignment of the estimates to the references. Pure. Least squares after S. Umeyama,
/// "Least-squares estimation of transformation parameters between two point patterns", PAMI 1991,
/// eq. (34)-(43). Errors: no pair; for kSe3 and kSim3 also fewer than 3 pairs, and positions that
/// all lie at one point or on one line, which leave the rotation open.
[[nodiscard]] Result<Similarity> align(const PosePairs& pairs, Alignment alignment);

/// The pairs with every estimate moved into the reference's frame.
[[nodiscard]] PosePairs transformed(const Similarity& alignment, PosePairs pairs);

}  // namespace geoflow::tools
