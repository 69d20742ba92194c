#include "geoflow/tools/bench/processes.hpp"

#include <csignal>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/data.hpp"

namespace geoflow::tools {
namespace {

using testing::HasSubstr;

Command shell(const std::string& script) {
  return {.arguments = {"/bin/sh", "-c", script}};
}

bool always(std::size_t /*done*/) {
  return true;
}

std::string content(const std::filesystem::path& file) {
  std::ostringstream text;
  text << std::ifstream{file}.rdbuf();
  return text.str();
}

TEST(Processes, EachEndIsReportedInItsPlace) {
  const std::vector<Command> commands = {shell("exit 0"), shell("exit 3"), shell("kill -9 $$")};
  for (const std::size_t at_a_time : {1U, 2U, 8U}) {
    const auto ended = run_processes(commands, at_a_time, always);
    ASSERT_TRUE(ended) << ended.error().message;
    ASSERT_EQ(ended->size(), 3U);
    EXPECT_TRUE((*ended)[0].well());
    EXPECT_EQ((*ended)[1].how(), "exit code 3");
    EXPECT_EQ((*ended)[2].how(), "signal 9");
  }
}

/// Two that wait for each other end only where they run at once.
TEST(Processes, RunSideBySide) {
  const tests::TemporaryDirectory folder;
  const std::string pipe = (folder.path() / "pipe").string();
  const std::vector<Command> commands = {
      shell("mkfifo " + pipe + ".1 2>/dev/null; until [ -p " + pipe + ".2 ]; do sleep 0.01; done"),
      shell("mkfifo " + pipe + ".2 2>/dev/null; until [ -p " + pipe + ".1 ]; do sleep 0.01; done")};
  const auto ended = run_processes(commands, 2, always);
  ASSERT_TRUE(ended);
  EXPECT_TRUE((*ended)[0].well() && (*ended)[1].well());
}

TEST(Processes, WhatTheySayGoesToTheLog) {
  const tests::TemporaryDirectory folder;
  Command command = shell("echo out; echo err >&2");
  command.log = folder.path() / "log.txt";
  ASSERT_TRUE(run_processes({&command, 1}, 1, always));
  EXPECT_EQ(content(command.log), "out\nerr\n");
}

TEST(Processes, StoppingEndsThoseThatRunAndStartsNoMore) {
  const tests::TemporaryDirectory folder;
  const std::string mark = (folder.path() / "mark").string();
  const std::vector<Command> commands = {shell("exit 0"), shell("exec sleep 600"),
                                         shell("touch " + mark)};
  const auto ended = run_processes(commands, 2, [](std::size_t done) { return done == 0; });
  ASSERT_TRUE(ended);
  EXPECT_TRUE((*ended)[0].well());
  EXPECT_EQ((*ended)[1].signal, SIGTERM);
  EXPECT_FALSE((*ended)[2].well());
  EXPECT_FALSE(std::filesystem::exists(mark));
}

TEST(Processes, AProgramThatIsNotThereIsNamed) {
  const std::vector<Command> commands = {shell("exec sleep 600"),
                                         {.arguments = {"/nowhere/at-all"}}};
  const auto ended = run_processes(commands, 2, always);
  ASSERT_FALSE(ended);
  EXPECT_THAT(ended.error().message, HasSubstr("/nowhere/at-all"));
}

TEST(Processes, ALineCanBePastedIntoAShell) {
  EXPECT_EQ(shell_line({"geoflow", "replay", "/a/b c", "-o", "it's", "--set", "a.b=true", ""}),
            "geoflow replay '/a/b c' -o 'it'\\''s' --set a.b=true ''");
  const tests::TemporaryDirectory folder;
  const std::string odd = (folder.path() / "a $b 'c' \"d\"").string();
  Command command = shell(shell_line({"touch", odd}));
  ASSERT_TRUE(run_processes({&command, 1}, 1, always));
  EXPECT_TRUE(std::filesystem::exists(odd));
}

}  // namespace
}  // namespace geoflow::tools
