#include "geoflow/tools/verb.hpp"

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <CLI/App.hpp>
#include <CLI/Option.hpp>
#include <CLI/Validators.hpp>
#include <fmt/core.h>
#include <nlohmann/json.hpp>
#include <poll.h>
#include <sys/random.h>
#include <sys/types.h>
#include <tl/expected.hpp>

#include "geoflow/daemon/config.hpp"
#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/console.hpp"
#include "geoflow/tools/interrupt.hpp"
#include "geoflow/tools/page.hpp"

#include "view/assets.hpp"
#include "view/finished_run.hpp"
#include "view/follower.hpp"
#include "view/live_state.hpp"
#include "view/map_scene.hpp"
#include "view/web_server.hpp"

namespace geoflow::tools {
namespace {

constexpr std::uint16_t kDefaultPort = 8420;
constexpr double kDefaultRateHz = 15;
constexpr double kHighestRateHz = 60;
constexpr int kRetryMilliseconds = 500;

/// 128 bits from the kernel, in hexadecimal.
Result<std::string> random_token() {
  std::array<unsigned char, 16> bytes{};
  if (::getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size())) {
    return fail_errno("getrandom");
  }
  std::string token;
  for (const unsigned char byte : bytes) {
    token += fmt::format("{:02x}", byte);
  }
  return token;
}

using Text = std::shared_ptr<const std::string>;

/// The page, the map that it draws, and the run whose time line it has (`{}` while it is live).
std::vector<Resource> resources(MapScene& map, const Text& run) {
  const Text page =
      std::make_shared<const std::string>(fill_page(view_page(), {{"page.css", page_styles()},
                                                                  {"plot.js", plot_script()},
                                                                  {"scene.js", scene_script()},
                                                                  {"view.js", view_script()}}));
  const Resource shown_page{
      .path = "/", .type = "text/html; charset=utf-8", .content = [page] { return page; }};
  const Resource shown_map{.path = "/map", .type = "application/octet-stream", .content = [&map] {
                             return map.bytes();
                           }};
  const Resource shown_run{
      .path = "/run", .type = "application/json", .content = [run] { return run; }};
  return {shown_page, shown_map, shown_run};
}

/// `geoflow view`.
class ViewVerb final : public Verb {
 public:
  [[nodiscard]] std::string_view name() const override { return "view"; }
  [[nodiscard]] std::string_view summary() const override {
    return "Show the running daemon, or a finished run, on a page for a browser";
  }
  [[nodiscard]] std::string_view examples() const override;
  void declare(CLI::App& command) override;
  [[nodiscard]] Result<ExitCode> run(Console& console) override;

 private:
  std::string control_socket_ = daemon::SocketConfig{}.control.string();
  std::string pose_socket_ = daemon::SocketConfig{}.pose.string();
  WebServerOptions server_{.port = kDefaultPort};
  bool with_token_ = false;
  double rate_hz_ = kDefaultRateHz;
  std::string run_;  ///< empty: the running daemon
  std::string map_;

  [[nodiscard]] Result<void> serve(Console& console, const WebServerOptions& options) const;
};

std::string_view ViewVerb::examples() const {
  return "  geoflow view                              http://127.0.0.1:8420/, until Ctrl-C\n"
         "  geoflow view --listen 192.168.1.20        for other machines; the address that is "
         "printed has a\n"
         "                                            token, new at each start, without which "
         "nothing is shown\n"
         "  geoflow view out --map out.map            a run that geoflow replay wrote, with a time "
         "line\n"
         "  ssh -L 8420:127.0.0.1:8420 robot geoflow view\n"
         "                                            on another machine, through ssh\n"
         "The daemon need not run yet, and may come and go.";
}

void ViewVerb::declare(CLI::App& command) {
  auto* run = command.add_option("run", run_,
                                 "Folder that geoflow replay wrote, to be shown with a time line; "
                                 "without it the running daemon");
  command.add_option("--map", map_, "The run's map (geoflow replay --save-map)")->needs(run);
  command.add_option("--socket", control_socket_, "The daemon's control socket")
      ->capture_default_str();
  command.add_option("--pose-socket", pose_socket_, "The daemon's pose socket")
      ->capture_default_str();
  command.add_option("--listen", server_.address, "Numeric address to listen at")
      ->capture_default_str();
  command.add_option("--port", server_.port, "Port to listen at; 0: any that is free")
      ->capture_default_str();
  command.add_flag("--token", with_token_,
                   "Ask for a token on loopback too, where other users of this machine are not to "
                   "look");
  command.add_option("--rate", rate_hz_, "Poses a second at most")
      ->check(CLI::Range(1.0, kHighestRateHz))
      ->capture_default_str();
}

Result<ExitCode> ViewVerb::run(Console& console) {
  WebServerOptions options = server_;
  if (with_token_ || !is_loopback(options.address)) {
    auto token = random_token();
    if (!token) {
      return tl::unexpected{token.error()};
    }
    options.token = *token;
  }
  return serve(console, options).map([] { return ExitCode::kOk; });
}

Result<void> ViewVerb::serve(Console& console, const WebServerOptions& options) const {
  auto run =
      run_.empty() ? Result<nlohmann::json>{nlohmann::json::object()} : read_finished_run(run_);
  if (!run) {
    return tl::unexpected{std::move(run).error()};
  }
  const InterruptScope interrupt;
  LiveState state;
  MapScene map;
  if (!map_.empty()) {
    map.show(map_);
    if (const auto readable = map.bytes(); !readable) {
      return tl::unexpected{readable.error()};
    }
  }
  const auto server = WebServer::start(
      options, resources(map, std::make_shared<const std::string>(run->dump())), state);
  if (!server) {
    return tl::unexpected{server.error()};
  }
  console.line("{}", server->url());
  console.object({{"url", server->url()}, {"port", server->port()}});
  Follower follower{
      {.pose_socket = pose_socket_, .control_socket = control_socket_, .rate_hz = rate_hz_},
      state,
      map};
  while (!InterruptScope::requested()) {
    if (!run_.empty() || !follower.step()) {
      ::poll(nullptr, 0, kRetryMilliseconds);  // or until a signal
    }
  }
  return {};
}

}  // namespace

// NOLINTNEXTLINE(misc-use-internal-linkage): called by the generated list of verbs
std::unique_ptr<Verb> make_view_verb() {
  return std::make_unique<ViewVerb>();
}

}  // namespace geoflow::tools
