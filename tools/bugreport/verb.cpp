#include "geoflow/tools/verb.hpp"

#include <cstdint>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <memory>
#include <sstream>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <CLI/App.hpp>
#include <fmt/chrono.h>
#include <fmt/core.h>
#include <nlohmann/json.hpp>
#include <tl/expected.hpp>

#include "geoflow/daemon/version.hpp"
#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/console.hpp"
#include "geoflow/tools/daemon_text.hpp"
#include "geoflow/tools/live_client.hpp"

#include "bugreport/archive.hpp"
#include "bugreport/facts.hpp"

namespace geoflow::tools {
namespace {

using nlohmann::json;

constexpr int kIndent = 2;

std::string text_of(const json& value) {
  return value.dump(kIndent, ' ', false, json::error_handler_t::replace) + "\n";
}

/// `geoflow-bugreport-20260131-142500`, by UTC.
std::string default_name() {
  return fmt::format("geoflow-bugreport-{:%Y%m%d-%H%M%S}", fmt::gmtime(std::time(nullptr)));
}

class BugreportVerb final : public Verb {
 public:
  [[nodiscard]] std::string_view name() const override { return "bugreport"; }
  [[nodiscard]] std::string_view summary() const override {
    return "Pack configuration, status, versions, device facts and the last log into one archive";
  }
  [[nodiscard]] std::string_view examples() const override {
    return "  geoflow bugreport                         geoflow-bugreport-DATE.tar.gz in this "
           "folder\n"
           "  geoflow bugreport -o report.tar.gz --attach my-recording\n"
           "                                            with a recording, that is with images\n"
           "It holds no images and no map unless they are attached. Serial numbers and names of "
           "network\n"
           "interfaces are in it. A daemon that does not run is no error.";
  }

  void declare(CLI::App& command) override {
    daemon_.declare(command);
    command.add_option("-o,--output", output_, "Archive; by default it is named by the time")
        ->type_name("FILE");
    command.add_option("--config", config_, "The daemon's configuration file")
        ->type_name("FILE")
        ->capture_default_str();
    command.add_option("--attach", attached_, "A file or folder to put in as well; repeatable")
        ->type_name("PATH")
        ->allow_extra_args(false);
  }

  [[nodiscard]] Result<ExitCode> run(Console& console) override {
    const std::string name = default_name();
    const std::string file = output_.empty() ? name + ".tar.gz" : output_;
    return Staging::create(name)
        .and_then([&](const Staging& staging) {
          return fill(staging).and_then([&] { return staging.pack(file); });
        })
        .map([&] {
          std::error_code unknown;
          const std::uintmax_t bytes = std::filesystem::file_size(file, unknown);
          console.object({{"written", file}, {"bytes", bytes}, {"daemon", !status_.is_null()}});
          console.line("written: {} ({}){}", file, bytes_in_words(bytes),
                       status_.is_null() ? "; no daemon answered" : "");
          return ExitCode::kOk;
        });
  }

 private:
  [[nodiscard]] Result<void> fill(const Staging& staging) {
    const json configuration = ask_daemon();
    return staging.add("versions.txt", versions())
        .and_then([&] { return staging.add("status.json", text_of(status_)); })
        .and_then([&] { return staging.add("configuration.json", text_of(configuration)); })
        .and_then([&] { return staging.add("geoflow.toml", configuration_file()); })
        .and_then([&] { return staging.add("machine.txt", machine_facts()); })
        .and_then([&] { return staging.add("devices.txt", device_facts()); })
        .and_then([&] { return staging.add("log.txt", last_log(status_)); })
        .and_then([&] { return attach_all(staging); });
  }

  /// The configuration that holds; status_ is filled. Null, both, where no daemon answers.
  [[nodiscard]] json ask_daemon() {
    auto status = daemon_.connect().and_then([&] { return daemon_.status(); });
    if (!status) {
      trouble_ = status.error().message;
      return {};
    }
    status_ = std::move(*status);
    const auto reply = daemon_.ask({{"cmd", "config"}});
    return reply ? reply->value("config", json{}) : json{};
  }

  [[nodiscard]] std::string versions() const {
    return fmt::format(
        "geoflow {}\ngeoflowd {}\n", daemon::version(),
        status_.is_null() ? "does not answer: " + trouble_ : text_at(status_, "version"));
  }

  [[nodiscard]] std::string configuration_file() const {
    const std::ifstream stream{config_};
    if (!stream) {
      return fmt::format("# {} cannot be read\n", config_);
    }
    std::ostringstream text;
    text << stream.rdbuf();
    return text.str();
  }

  [[nodiscard]] Result<void> attach_all(const Staging& staging) const {
    Result<void> done;
    for (const std::string& path : attached_) {
      done = done ? staging.attach(path) : done;
    }
    return done;
  }

  LiveClient daemon_;
  std::string output_;
  std::string config_ = "/etc/geoflow/geoflow.toml";
  std::vector<std::string> attached_;
  json status_;
  std::string trouble_;
};

}  // namespace

// NOLINTNEXTLINE(misc-use-internal-linkage): called by the generated list of verbs
std::unique_ptr<Verb> make_bugreport_verb() {
  return std::make_unique<BugreportVerb>();
}

}  // namespace geoflow::tools
