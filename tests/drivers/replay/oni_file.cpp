#include "replay/oni_file.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>

namespace geoflow::drivers::tests {

template <typename T>
void OniFile::append(std::string& to, T value) {
  std::array<char, sizeof(T)> bytes{};
  std::memcpy(bytes.data(), &value, sizeof(T));
  to.append(bytes.data(), bytes.size());
}

std::string OniFile::block(std::string_view content) {
  std::string block;
  append(block, static_cast<std::uint32_t>(content.size()));
  return block.append(content);
}

OniFile::OniFile() {
  bytes_ = "NI10";
  bytes_.append({1, 0, 1, 0, 0, 0, 0, 0});
  append(bytes_, std::uint64_t{~0ULL});
  append(bytes_, std::uint32_t{2});
}

OniFile& OniFile::record(std::uint32_t type, std::uint32_t id, const std::string& fields,
                         std::span<const std::byte> payload) {
  constexpr std::uint32_t kHeaderBytes = 28;
  append(bytes_, std::uint32_t{0x0052494e});
  append(bytes_, type);
  append(bytes_, id);
  append(bytes_, kHeaderBytes + static_cast<std::uint32_t>(fields.size()));
  append(bytes_, static_cast<std::uint32_t>(payload.size()));
  append(bytes_, std::uint64_t{0});
  bytes_.append(fields);
  for (const std::byte byte : payload) {
    bytes_.push_back(static_cast<char>(byte));
  }
  return *this;
}

OniFile& OniFile::property(std::uint32_t type, std::uint32_t id, std::string_view name,
                           const std::string& value) {
  return record(type, id, block(std::string{name} + '\0') + block(value), {});
}

OniFile& OniFile::add_node(std::uint32_t id, std::uint32_t kind, std::string_view codec) {
  std::string fields = block(std::string_view{"node\0", 5});
  append(fields, kind);
  fields.append(codec);
  append(fields, std::uint32_t{2});
  append(fields, std::uint64_t{0});
  append(fields, std::uint64_t{33'333});
  append(fields, std::uint64_t{0});
  return record(0x0d, id, fields, {});
}

OniFile& OniFile::add_size(std::uint32_t id, std::uint32_t width, std::uint32_t height) {
  std::string value;
  append(value, width);
  append(value, height);
  append(value, std::uint32_t{30});
  return property(0x06, id, "xnMapOutputMode", value);
}

OniFile& OniFile::add_pixel_format(std::uint32_t id, std::uint64_t format) {
  std::string value;
  append(value, format);
  return property(0x03, id, "oniPixelFormat", value);
}

OniFile& OniFile::add_fields_of_view(std::uint32_t id, double horizontal_rad, double vertical_rad) {
  std::string value;
  append(value, horizontal_rad);
  append(value, vertical_rad);
  return property(0x06, id, "xnFOV", value);
}

OniFile& OniFile::add_frame(std::uint32_t id, std::uint64_t t_us,
                            std::span<const std::byte> bytes) {
  std::string fields;
  append(fields, t_us);
  append(fields, std::uint32_t{1});
  return record(0x0a, id, fields, bytes);
}

OniFile& OniFile::end() {
  return record(0x0b, 0, {}, {});
}

OniFile small_oni_file() {
  constexpr std::array kDepth{std::byte{2},    std::byte{0},                    // two depths:
                              std::byte{0xe8}, std::byte{3},                    // 1000
                              std::byte{0xd0}, std::byte{7},                    // 2000
                              std::byte{0},    std::byte{0}, std::byte{0x5d}};  // 0, then +1
  constexpr std::array kColor{std::byte{255}, std::byte{0}, std::byte{0},
                              std::byte{0},   std::byte{0}, std::byte{255}};
  OniFile file;
  file.add_node(1, 2, "16zT").add_size(1, 2, 1).add_pixel_format(1, 100);
  file.add_node(2, 3, "NONE").add_size(2, 2, 1).add_pixel_format(2, 200);
  file.add_fields_of_view(2, 1.0, 0.75);
  for (const std::uint64_t t_us : {0ULL, 33'333ULL}) {
    file.add_frame(1, t_us, kDepth).add_frame(2, t_us, kColor);
  }
  return file.end();
}

}  // namespace geoflow::drivers::tests
