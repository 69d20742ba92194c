#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <utility>

#include <dds/dds.h>
#include <dds/ddsi/ddsi_serdata.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <tl/expected.hpp>
#include <unistd.h>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/unique_fd.hpp"

#include "dds/channel.hpp"
#include "dds/low_state.hpp"
#include "dds/session.hpp"

// Made by idlc from LowState.idl; its header would drag C into the includes of this part.
// NOLINTNEXTLINE(readability-identifier-naming,bugprone-reserved-identifier): as idlc names it
extern "C" const dds_topic_descriptor_t unitree_go_msg_dds__LowState__desc;

namespace geoflow::drivers::dds {
namespace {

constexpr std::int32_t kHistory = 500;  // messages that may wait: a second's
constexpr std::size_t kBatch = 64;
constexpr dds_duration_t kLongestBlock =
    std::chrono::nanoseconds{std::chrono::milliseconds{100}}.count();

Qos make_qos(dds_reliability_kind_t reliability) {
  Qos qos{::dds_create_qos()};
  ::dds_qset_reliability(qos.get(), reliability, kLongestBlock);
  ::dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, kHistory);
  return qos;
}

/// A session with the topic of the robot's messages.
struct LowStateSession : Session {
  dds_entity_t topic = 0;
};

Result<LowStateSession> open_session(const Address& address) {
  auto session = join(address);
  if (!session) {
    return tl::unexpected{std::move(session.error())};
  }
  const auto topic = open_topic(*session, address, unitree_go_msg_dds__LowState__desc);
  if (!topic) {
    return tl::unexpected{topic.error()};
  }
  return LowStateSession{*std::move(session), *topic};
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
    session_.reset();
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
    session_.emplace(*std::move(session));
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
  std::optional<LowStateSession> session_;
  dds_entity_t reader_ = 0;
  dds_entity_t condition_ = 0;
  dds_entity_t waitset_ = 0;
  std::atomic<dds_entity_t> guard_{0};  // set while woken, for read(); 0 while closed
};

class CyclonePublisher final : public Publisher {
 public:
  CyclonePublisher(LowStateSession session, dds_entity_t writer, Address address)
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
  LowStateSession session_;
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
