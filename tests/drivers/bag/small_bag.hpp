#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include <fmt/core.h>
#include <sqlite3.h>
#include <zstd.h>

#include "geoflow/hal/result.hpp"

#include "replay/bag/bag.hpp"

/// Bags made by hand, as other software would make them.
namespace geoflow::drivers::test {

inline std::string read_file(const std::filesystem::path& path) {
  std::ifstream file{path, std::ios::binary};
  return {std::istreambuf_iterator<char>{file}, {}};
}

inline void write_file(const std::filesystem::path& path, std::string_view content) {
  std::ofstream{path, std::ios::binary} << content;
}

inline std::string zstd(const std::string& content) {
  std::string frame(ZSTD_compressBound(content.size()), '\0');
  frame.resize(ZSTD_compress(frame.data(), frame.size(), content.data(), content.size(), 1));
  return frame;
}

/// A database to which SQL statements are applied.
class SqlFile {
 public:
  explicit SqlFile(const std::filesystem::path& path) {
    sqlite3* database = nullptr;
    sqlite3_open(path.c_str(), &database);
    database_.reset(database);
  }
  void execute(const std::string& sql) const {
    if (sqlite3_exec(database_.get(), sql.c_str(), nullptr, nullptr, nullptr) != SQLITE_OK) {
      throw std::runtime_error{sqlite3_errmsg(database_.get())};
    }
  }

 private:
  struct Close {
    void operator()(sqlite3* database) const { sqlite3_close(database); }
  };
  std::unique_ptr<sqlite3, Close> database_;
};

/// Schema 1, as rosbag2 of 2019 wrote it (no QoS, no metadata inside), on small pages. The messages
/// of /a are `count` strings m0, m1, … at `start_ns`, `start_ns` + `step_ns`, …, each as long as
/// `bytes` says.
struct SmallBag {
  std::int64_t start_ns = 1000;
  std::int64_t step_ns = 10;
  int count = 20;
  std::size_t bytes = 300;

  void write(const std::filesystem::path& path) const {
    const SqlFile file{path};
    file.execute(
        "PRAGMA page_size=512;"
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,"
        " serialization_format TEXT NOT NULL);"
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp "
        "INTEGER NOT NULL,"
        " data BLOB NOT NULL);"
        "CREATE INDEX timestamp_idx ON messages (timestamp ASC);"
        "INSERT INTO topics VALUES (7, '/a', 'test/msg/A', 'cdr');"
        "BEGIN");
    for (int i = 0; i < count; ++i) {
      std::string data = fmt::format("m{}", i);
      data.resize(bytes, '.');
      file.execute("INSERT INTO messages (topic_id, timestamp, data) VALUES (7, " +
                   std::to_string(start_ns + i * step_ns) + ", '" + data + "')");
    }
    file.execute("COMMIT");
  }
};

/// What reading a bag to its end gave.
struct Reading {
  std::vector<std::int64_t> times_ns;
  std::vector<std::string> data;
  std::vector<Error> errors;  ///< of open() or of messages
  bool complete = false;
};

inline Reading read_all(const std::filesystem::path& path) {
  Reading reading;
  const auto bag = bag::Bag::open(path);
  if (!bag) {
    reading.errors.push_back(bag.error());
    return reading;
  }
  (*bag)->select([](std::string_view) { return true; });
  while (true) {
    const auto message = (*bag)->next();
    if (!message) {
      reading.errors.push_back(message.error());
    } else if (*message) {
      reading.times_ns.push_back((*message)->timestamp_ns);
      std::string& text = reading.data.emplace_back();
      for (const std::byte byte : (*message)->data) {
        text += static_cast<char>(byte);
      }
    } else {
      break;
    }
  }
  reading.complete = (*bag)->complete();
  return reading;
}

}  // namespace geoflow::drivers::test
