#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "geoflow/hal/result.hpp"

#include "d435i/core/transport.hpp"
#include "v4l2/topology.hpp"

namespace geoflow::drivers::d435i {

/// The camera through the kernel's drivers: video and metadata nodes of uvcvideo, the extension
/// unit by UVCIOC_CTRL_QUERY, and the IIO sensors. kNotFound where a node that is needed is not
/// there, with the module that makes it.
[[nodiscard]] Result<std::unique_ptr<Transport>> open_v4l2_transport(const v4l2::UsbCamera& camera);

/// The payload header in a metadata buffer (struct uvc_meta_buf: 8 bytes of host time, 2 of the
/// bus's frame number, then the header), of which the kernel may have kept the standard part alone:
/// its length is made that of what is there. Empty where there is none. Pure.
[[nodiscard]] std::vector<std::byte> header_in_metadata(std::span<const std::byte> buffer);

}  // namespace geoflow::drivers::d435i
