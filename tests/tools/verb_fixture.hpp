#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/tools/run.hpp"
#include "geoflow/tools/verb.hpp"
#include "tests/support/data.hpp"

namespace geoflow::tools::tests {

/// Runs one verb as the command would, with a folder of its own.
class VerbTest : public testing::Test {
 protected:
  using MakeVerb = std::unique_ptr<Verb> (*)();
  explicit VerbTest(MakeVerb make) : make_{make} {}

  [[nodiscard]] std::string file(const std::string& name) const {
    return (folder_.path() / name).string();
  }

  /// `geoflow VERB arguments…`: the exit code; out_ and err_ are what was printed.
  int run(std::vector<std::string> arguments) {
    std::vector<std::unique_ptr<Verb>> verbs;
    verbs.push_back(make_());
    arguments.insert(arguments.begin(), {"geoflow", std::string{verbs.front()->name()}});
    std::vector<const char*> argv;
    argv.reserve(arguments.size());
    for (const std::string& argument : arguments) {
      argv.push_back(argument.c_str());
    }
    testing::internal::CaptureStdout();
    testing::internal::CaptureStderr();
    const int code =
        run_command("test", std::move(verbs), static_cast<int>(argv.size()), argv.data());
    out_ = testing::internal::GetCapturedStdout();
    err_ = testing::internal::GetCapturedStderr();
    return code;
  }

  geoflow::tests::TemporaryDirectory folder_;
  std::string out_;
  std::string err_;

 private:
  MakeVerb make_;
};

}  // namespace geoflow::tools::tests
