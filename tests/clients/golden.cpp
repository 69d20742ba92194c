#include "golden.hpp"

#include <charconv>
#include <cstddef>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

namespace geoflow::tests {

std::map<std::string, std::vector<std::byte>> golden_records(const std::string& version) {
  std::map<std::string, std::vector<std::byte>> records;
  std::ifstream file{std::string{GEOFLOW_GOLDEN} + "/protocol-" + version + ".txt"};
  for (std::string line; std::getline(file, line);) {
    std::istringstream words{line};
    std::string name;
    std::string digits;
    if (line.starts_with('#') || !(words >> name >> digits)) {
      continue;
    }
    std::vector<std::byte>& bytes = records[name];
    for (std::size_t i = 0; i + 1 < digits.size(); i += 2) {
      unsigned value = 0;
      std::from_chars(&digits[i], &digits[i] + 2, value, 16);
      bytes.push_back(static_cast<std::byte>(value));
    }
  }
  return records;
}

}  // namespace geoflow::tests
