#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include <dds/dds.h>
#include <dds/ddsi/ddsi_serdata.h>
#include <fmt/core.h>
#include <net/if.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <tl/expected.hpp>
#include <unistd.h>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/unique_fd.hpp"

#include "dds/channel.hpp"
#include "dds/low_state.hpp"

// Made by idlc from LowState.idl; its header would drag C into the includes of this part.
// NOLINTNEXTLINE(readability-identifier-naming,bugprone-reserved-identifier): as idlc names it
extern "C" const dds_topic_descriptor_t unitree_go_msg_dds__LowState__desc;

namespace geoflow::drivers::dds {
namespace {

constexpr std::int32_t kHistory = 500;  // messages that may wait: a second's
constexpr std::size_t kBatch = 64;
constexpr dds_duration_t kLongestBlock =
    std::chrono::nanoseconds{std::chrono::milliseconds{100}}.count();

/// One entity of Cyclone DDS; deleting one deletes what was made of it.
class Entity {
 public:
  Entity() = default;
  explicit Entity(dds_entity_t handle) noexcept : handle_{handle} {}
  Entity(Entity&& other) noexcept : handle_{std::exchange(other.handle_, 0)} {}
  Entity& operator=(Entity&& other) noexcept {
    std::swap(handle_, other.handle_);
    return *this;
  }
  Entity(const Entity&) = delete;
  Entity& operator=(const Entity&) = delete;
  ~Entity() {
    if (handle_ > 0) {
      (void)::dds_delete(handle_);
    }
  }
  [[nodiscard]] dds_entity_t get() const noexcept { return handle_; }
  [[nodiscard]] explicit operator bool() const noexcept { return handle_ > 0; }

 private:
  dds_entity_t handle_ = 0;
};

tl::unexpected<Error> refused(const Address& address, std::string_view what, dds_return_t code) {
  return fail(ErrorCode::kUnavailable, "{}: {}: {}", address.to_string(), what,
              ::dds_strretcode(code));
}

/// A domain with its participant and topic.
struct Session {
  Entity domain;  // none where another part of the process has made it
  Entity participant;
  dds_entity_t topic = 0;
};

Result<Session> open_session(const Address& address) {
  Session session;
  if (!address.interface.empty()) {
    if (::if_nametoindex(address.interface.c_str()) == 0) {
      return fail(ErrorCode::kNotFound, "{}: no such network interface", address.to_string());
    }
    const std::string settings = fmt::format(
        "<CycloneDDS><Domain id=\"any\"><General><Interfaces><NetworkInterface name=\"{}\"/>"
        "</Interfaces></General></Domain></CycloneDDS>",
        address.interface);
    session.domain = Entity{::dds_create_domain(address.domain, settings.c_str())};
    const dds_return_t code = session.domain.get();
    if (!session.domain && code != DDS_RETCODE_PRECONDITION_NOT_MET) {
      return refused(address, "the interface cannot be used (has it an address?)", code);
    }
  }
  session.participant = Entity{::dds_create_participant(address.domain, nullptr, nullptr)};
  if (!session.participant) {
    return refused(address, "DDS cannot be joined", session.participant.get());
  }
  session.topic = ::dds_create_topic(session.participant.get(), &unitree_go_msg_dds__LowState__desc,
                                     address.topic.c_str(), nullptr, nullptr);
  if (session.topic < 0) {
    return refused(address, "is no topic", session.topic);
  }
  return session;
}

struct QosDeleter {
  void operator()(dds_qos_t* qos) const noexcept { ::dds_delete_qos(qos); }
};

std::unique_ptr<dds_qos_t, QosDeleter> make_qos(dds_reliability_kind_t reliability) {
  std::unique_ptr<dds_qos_t, QosDeleter> qos{::dds_create_qos()};
  ::dds_qset_reliability(qos.get(), reliability, kLongestBlock);
  ::dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, kHistory);
  return qos;
}

/// Hands the bytes of one message over.
void hand_over(ddsi_serdata* message, MessageSink& sink, HostTime t_arrival) {
  ddsrt_iovec_t bytes{};
  ddsi_serdata* const locked =
      ::ddsi_serdata_to_ser_ref(message, 0, ::ddsi_serdata_size(message), &bytes);
  sink.on_message({static_cast<const std::byte*>(bytes.iov_base), bytes.iov_len}, t_arrival);
  ::ddsi_serdata_to_ser_unref(locked, &bytes);
}

class Subscriber final : public Channel {
 public:
  Subscriber(Address address, UniqueFd bell)
      : address_{std::move(address)}, bell_{std::move(bell)} {}

  Result<void> open() override {
    guard_.store(0);
    session_ = {};
    auto session = open_session(address_);
    if (!session) {
      return tl::unexpected{std::move(session.error())};
    }
    const dds_entity_t participant = session->participant.get();
    reader_ = ::dds_create_reader(participant, session->topic,
                                  make_qos(DDS_RELIABILITY_BEST_EFFORT).get(), nullptr);
    condition_ = reader_ > 0 ? ::dds_create_readcondition(reader_, DDS_ANY_STATE) : reader_;
    waitset_ = ::dds_create_waitset(participant);
    const dds_entity_t guard = ::dds_create_guardcondition(participant);
    if (condition_ < 0 || waitset_ < 0 || guard < 0 ||
        ::dds_waitset_attach(waitset_, condition_, 0) != DDS_RETCODE_OK ||
        ::dds_waitset_attach(waitset_, guard, 0) != DDS_RETCODE_OK) {
      return refused(address_, "cannot be read", condition_ < 0 ? condition_ : DDS_RETCODE_ERROR);
    }
    session_ = *std::move(session);
    guard_.store(guard);
    return {};
  }

  Result<void> read(MessageSink& sink, Duration timeout) override {
    const dds_return_t woken = ::dds_waitset_wait(waitset_, nullptr, 0, timeout.count());
    if (woken < 0) {
      return refused(address_, "cannot be waited for", woken);
    }
    (void)::dds_set_guardcondition(guard_.load(), false);
    std::array<ddsi_serdata*, kBatch> messages{};
    std::array<dds_sample_info_t, kBatch> infos{};
    dds_return_t count = kBatch;
    while (count == static_cast<dds_return_t>(kBatch)) {
      count = ::dds_takecdr(reader_, messages.data(), kBatch, infos.data(), DDS_ANY_STATE);
      const HostTime now = HostClock::now();
      for (std::size_t i = 0; std::cmp_less(i, count); ++i) {
        if (infos[i].valid_data) {
          hand_over(messages[i], sink, now);
        }
        ::ddsi_serdata_unref(messages[i]);
      }
    }
    return count < 0 && count != DDS_RETCODE_NO_DATA
               ? Result<void>{refused(address_, "cannot be read", count)}
               : Result<void>{};
  }

  [[nodiscard]] std::uint32_t writers() const override {
    dds_subscription_matched_status_t status{};
    return reader_ > 0 && ::dds_get_subscription_matched_status(reader_, &status) == DDS_RETCODE_OK
               ? status.current_count
               : 0;
  }

  void pause(Duration timeout) override {
    pollfd waiting{.fd = bell_.get(), .events = POLLIN, .revents = 0};
    (void)::poll(&waiting, 1,
                 static_cast<int>(std::chrono::ceil<std::chrono::milliseconds>(timeout).count()));
    std::uint64_t rung = 0;
    (void)!::read(bell_.get(), &rung, sizeof rung);
  }

  void wake() noexcept override {
    (void)::dds_set_guardcondition(guard_.load(), true);
    const std::uint64_t one = 1;
    (void)!::write(bell_.get(), &one, sizeof one);
  }

 private:
  Address address_;
  UniqueFd bell_;  // readable while woken, for pause()
  Session session_;
  dds_entity_t reader_ = 0;
  dds_entity_t condition_ = 0;
  dds_entity_t waitset_ = 0;
  std::atomic<dds_entity_t> guard_{0};  // set while woken, for read(); 0 while closed
};

class CyclonePublisher final : public Publisher {
 public:
  CyclonePublisher(Session session, dds_entity_t writer, Address address)
      : session_{std::move(session)}, writer_{writer}, address_{std::move(address)} {}

  Result<void> write(const LowState& state) override {
    const auto image = memory_image(state);  // what idlc's struct is in memory
    const dds_return_t written = ::dds_write(writer_, image.data());
    return written == DDS_RETCODE_OK
               ? Result<void>{}
               : Result<void>{refused(address_, "cannot be written", written)};
  }
  [[nodiscard]] std::uint32_t readers() const override {
    dds_publication_matched_status_t status{};
    return ::dds_get_publication_matched_status(writer_, &status) == DDS_RETCODE_OK
               ? status.current_count
               : 0;
  }

 private:
  Session session_;
  dds_entity_t writer_;
  Address address_;
};

}  // namespace

Result<std::unique_ptr<Channel>> make_subscriber(const Address& address) {
  UniqueFd bell{::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)};
  if (!bell) {
    return fail_errno("eventfd");
  }
  return std::make_unique<Subscriber>(address, std::move(bell));
}

Result<std::unique_ptr<Publisher>> make_publisher(const Address& address) {
  auto session = open_session(address);
  if (!session) {
    return tl::unexpected{std::move(session.error())};
  }
  const dds_entity_t writer =
      ::dds_create_writer(session->participant.get(), session->topic,
                          make_qos(DDS_RELIABILITY_RELIABLE).get(), nullptr);
  if (writer < 0) {
    return refused(address, "cannot be written", writer);
  }
  return std::make_unique<CyclonePublisher>(*std::move(session), writer, address);
}

}  // namespace geoflow::drivers::dds
