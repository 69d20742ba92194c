#include "geoflow/tools/verb.hpp"

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <CLI/App.hpp>
#include <CLI/Validators.hpp>
#include <nlohmann/json.hpp>
#include <poll.h>
#include <tl/expected.hpp>
#include <unistd.h>

#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/console.hpp"
#include "geoflow/tools/interrupt.hpp"
#include "geoflow/tools/live_client.hpp"

#include "top/table.hpp"

namespace geoflow::tools {
namespace {

constexpr double kShortestIntervalS = 0.1;
constexpr double kLongestIntervalS = 60;

/// The terminal's other screen while it lives: what was on it before is there again afterwards.
class Screen {
 public:
  explicit Screen(bool used) : used_{used} { write("\x1b[?1049h\x1b[?25l"); }
  Screen(const Screen&) = delete;
  Screen& operator=(const Screen&) = delete;
  ~Screen() { write("\x1b[?25h\x1b[?1049l"); }

  void draw(const std::vector<std::string>& lines, Console& console) const {
    std::string text = used_ ? "\x1b[H" : "";
    for (const std::string& line : lines) {
      text += line + (used_ ? "\x1b[K\n" : "\n");
    }
    console.line("{}{}", text, used_ ? "\x1b[J" : "");
  }

 private:
  void write(std::string_view sequence) const {
    if (used_) {
      std::fwrite(sequence.data(), 1, sequence.size(), stdout);
      std::fflush(stdout);
    }
  }

  bool used_;
};

class TopVerb final : public Verb {
 public:
  [[nodiscard]] std::string_view name() const override { return "top"; }
  [[nodiscard]] std::string_view summary() const override {
    return "Show sensors, times of the stages, rates and clients of the running daemon, live";
  }
  [[nodiscard]] std::string_view examples() const override {
    return "  geoflow top                               once a second, until Ctrl-C\n"
           "  geoflow top --interval 5 --count 3 | cat  three tables, one after the other\n"
           "  geoflow top --json | jq .rates.sources    for scripts";
  }

  void declare(CLI::App& command) override {
    daemon_.declare(command);
    command.add_option("--interval", interval_s_, "Time between two looks [s]")
        ->check(CLI::Range(kShortestIntervalS, kLongestIntervalS))
        ->capture_default_str();
    command.add_option("--count", count_, "End after so many tables; 0: do not");
  }

  [[nodiscard]] Result<ExitCode> run(Console& console) override {
    return daemon_.connect()
        .and_then([&] { return daemon_.status(); })
        .and_then([&](nlohmann::json first) { return look(std::move(first), console); });
  }

 private:
  [[nodiscard]] Result<ExitCode> look(nlohmann::json before, Console& console) {
    const InterruptScope interrupt;
    const Screen screen{!console.json() && ::isatty(STDOUT_FILENO) == 1};
    for (std::uint64_t shown = 0; count_ == 0 || shown < count_; ++shown) {
      wait();
      if (InterruptScope::requested()) {
        break;
      }
      auto status = daemon_.status();
      if (!status) {
        return tl::unexpected{std::move(status.error())};
      }
      const nlohmann::json grown = rates(before, *status);
      console.object({{"rates", grown}, {"status", *status}});
      screen.draw(top_lines(*status, grown), console);
      before = std::move(*status);
    }
    return ExitCode::kOk;
  }

  /// The interval, or until a signal.
  void wait() const {
    const auto milliseconds =
        std::chrono::ceil<std::chrono::milliseconds>(from_seconds(interval_s_));
    (void)::poll(nullptr, 0, static_cast<int>(milliseconds.count()));
  }

  LiveClient daemon_;
  double interval_s_ = 1;
  std::uint64_t count_ = 0;
};

}  // namespace

// NOLINTNEXTLINE(misc-use-internal-linkage): called by the generated list of verbs
std::unique_ptr<Verb> make_top_verb() {
  return std::make_unique<TopVerb>();
}

}  // namespace geoflow::tools
