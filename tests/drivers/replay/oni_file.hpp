#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

/// An .oni file, record by record, as OpenNI2's recorder writes it.
namespace geoflow::drivers::tests {

class OniFile {
 public:
  OniFile();

  /// kind: 2 depth, 3 colour. codec: four characters.
  OniFile& add_node(std::uint32_t id, std::uint32_t kind, std::string_view codec);
  OniFile& add_size(std::uint32_t id, std::uint32_t width, std::uint32_t height);
  OniFile& add_pixel_format(std::uint32_t id, std::uint64_t format);
  OniFile& add_fields_of_view(std::uint32_t id, double horizontal_rad, double vertical_rad);
  OniFile& add_frame(std::uint32_t id, std::uint64_t t_us, std::span<const std::byte> bytes);
  OniFile& end();

  [[nodiscard]] std::string& bytes() noexcept { return bytes_; }

 private:
  template <typename T>
  static void append(std::string& to, T value);
  static std::string block(std::string_view content);
  OniFile& record(std::uint32_t type, std::uint32_t id, const std::string& fields,
                  std::span<const std::byte> payload);
  OniFile& property(std::uint32_t type, std::uint32_t id, std::string_view name,
                    const std::string& value);

  std::string bytes_;
};

/// A whole file of 2x1 pixels: depth by 16z with table, colour as RGB888; two frames of each.
[[nodiscard]] OniFile small_oni_file();

}  // namespace geoflow::drivers::tests
