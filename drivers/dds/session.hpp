#pragma once

#include <memory>
#include <string_view>
#include <utility>

#include <dds/dds.h>
#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"

#include "dds/channel.hpp"

/// What readers and writers on Cyclone DDS have in common. Any thread, but one object is one
/// thread's.
namespace geoflow::drivers::dds {

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

struct QosDeleter {
  void operator()(dds_qos_t* qos) const noexcept { ::dds_delete_qos(qos); }
};
using Qos = std::unique_ptr<dds_qos_t, QosDeleter>;

/// An error that names where, what was tried, and DDS's own words.
[[nodiscard]] tl::unexpected<Error> refused(const Address& address, std::string_view what,
                                            dds_return_t code);

struct Domain;

/// A participant in a domain.
struct Session {
  std::shared_ptr<const Domain> domain;  // outlives the participant
  Entity participant;
};

/// Joins the address's domain on its interface. A process has a domain once, on one interface: all
/// that join it share it, and it ends with the last. Errors: kNotFound for an interface that is not
/// there, kInvalidArgument for another one than the domain has already, kUnavailable.
[[nodiscard]] Result<Session> join(const Address& address);

/// The address's topic, owned by the session.
[[nodiscard]] Result<dds_entity_t> open_topic(const Session& session, const Address& address,
                                              const dds_topic_descriptor_t& type);

}  // namespace geoflow::drivers::dds
