#include "geoflow/tools/run.hpp"

#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <CLI/App.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/console.hpp"
#include "geoflow/tools/verb.hpp"

namespace geoflow::tools {
namespace {

using testing::HasSubstr;

/// A verb that says a word, fails as told, or throws.
class ScriptedVerb final : public Verb {
 public:
  [[nodiscard]] std::string_view name() const override { return "scripted"; }
  [[nodiscard]] std::string_view summary() const override { return "does as told"; }
  [[nodiscard]] std::string_view examples() const override {
    return "  geoflow scripted --word hello";
  }
  void declare(CLI::App& command) override {
    command.add_option("--word", word_, "What to say");
    command.add_option("--fail", fail_, "ErrorCode to fail with");
    command.add_flag("--throw", throw_, "Throw");
  }
  [[nodiscard]] Result<ExitCode> run(Console& console) override {
    if (throw_) {
      throw std::runtime_error{"thrown"};
    }
    if (fail_) {
      return fail(static_cast<ErrorCode>(*fail_), "told to fail");
    }
    console.line("{}", word_);
    console.object({{"word", word_}});
    return ExitCode::kOk;
  }

 private:
  std::string word_;
  std::optional<int> fail_;
  bool throw_ = false;
};

struct Outcome {
  int code = 0;
  std::string out;
  std::string err;
};

Outcome run(std::vector<const char*> arguments) {
  arguments.insert(arguments.begin(), "geoflow");
  std::vector<std::unique_ptr<Verb>> verbs;
  verbs.push_back(std::make_unique<ScriptedVerb>());
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  Outcome outcome;
  outcome.code =
      run_command("1.2.3", std::move(verbs), static_cast<int>(arguments.size()), arguments.data());
  outcome.out = testing::internal::GetCapturedStdout();
  outcome.err = testing::internal::GetCapturedStderr();
  return outcome;
}

TEST(RunCommand, RunsTheVerbAndPrintsTextOrJson) {
  EXPECT_EQ(run({"scripted", "--word", "hello"}).out, "hello\n");
  EXPECT_EQ(run({"scripted", "--word", "hello", "--json"}).out, "{\"word\":\"hello\"}\n");
}

TEST(RunCommand, HelpShowsExamplesAndExitsZero) {
  const Outcome outcome = run({"scripted", "--help"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.out, HasSubstr("geoflow scripted --word hello"));
  EXPECT_THAT(run({"--version"}).out, HasSubstr("1.2.3"));
}

TEST(RunCommand, UsageErrorsExitTwo) {
  EXPECT_EQ(run({}).code, 2);
  EXPECT_EQ(run({"unknown"}).code, 2);
  const Outcome outcome = run({"scripted", "--no-such-option"});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("--no-such-option"));
}

TEST(RunCommand, AnErrorsKindDecidesTheExitCode) {
  const std::vector<std::pair<ErrorCode, int>> kinds = {
      {ErrorCode::kNotFound, 3},    {ErrorCode::kInvalidData, 3}, {ErrorCode::kInvalidArgument, 2},
      {ErrorCode::kUnsupported, 3}, {ErrorCode::kUnavailable, 4}, {ErrorCode::kSystem, 1}};
  for (const auto& [code, expected] : kinds) {
    const std::string number = std::to_string(static_cast<int>(code));
    const Outcome outcome = run({"scripted", "--json", "--fail", number.c_str()});
    EXPECT_EQ(outcome.code, expected);
    EXPECT_EQ(nlohmann::json::parse(outcome.out)["error"]["code"], error_name(code));
    EXPECT_THAT(outcome.err, HasSubstr("geoflow scripted: told to fail"));
  }
}

TEST(RunCommand, AnExceptionBecomesAFailure) {
  const Outcome outcome = run({"scripted", "--throw"});
  EXPECT_EQ(outcome.code, 1);
  EXPECT_THAT(outcome.err, HasSubstr("thrown"));
}

}  // namespace
}  // namespace geoflow::tools
