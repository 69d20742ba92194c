#include "dds/session.hpp"

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>

#include <dds/dds.h>
#include <fmt/core.h>
#include <net/if.h>
#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"

#include "dds/channel.hpp"

namespace geoflow::drivers::dds {

/// A domain that was made for an interface.
struct Domain {
  std::string interface;
  Entity entity;
};

namespace {

/// The domains of this process that were made for an interface.
class Domains {
 public:
  /// The address's domain; null where it names no interface and nobody has made it for one: then
  /// DDS makes it by itself.
  Result<std::shared_ptr<const Domain>> share(const Address& address) {
    const std::scoped_lock lock{mutex_};
    std::weak_ptr<const Domain>& known = domains_[address.domain];
    if (auto domain = known.lock()) {
      if (!address.interface.empty() && address.interface != domain->interface) {
        return fail(ErrorCode::kInvalidArgument,
                    "{}: this process has the domain on {} already, and can have it on one "
                    "interface only",
                    address.to_string(), domain->interface);
      }
      return domain;
    }
    if (address.interface.empty()) {
      return nullptr;
    }
    auto domain = make(address);
    if (domain) {
      known = *domain;
    }
    return domain;
  }

 private:
  static Result<std::shared_ptr<const Domain>> make(const Address& address) {
    if (::if_nametoindex(address.interface.c_str()) == 0) {
      return fail(ErrorCode::kNotFound, "{}: no such network interface", address.to_string());
    }
    const std::string settings = fmt::format(
        "<CycloneDDS><Domain id=\"any\"><General><Interfaces><NetworkInterface name=\"{}\"/>"
        "</Interfaces></General></Domain></CycloneDDS>",
        address.interface);
    Entity entity{::dds_create_domain(address.domain, settings.c_str())};
    if (!entity && entity.get() != DDS_RETCODE_PRECONDITION_NOT_MET) {
      return refused(address, "the interface cannot be used (has it an address?)", entity.get());
    }
    return std::make_shared<const Domain>(address.interface, std::move(entity));
  }

  std::mutex mutex_;
  std::map<std::uint32_t, std::weak_ptr<const Domain>> domains_;
};

}  // namespace

tl::unexpected<Error> refused(const Address& address, std::string_view what, dds_return_t code) {
  return fail(ErrorCode::kUnavailable, "{}: {}: {}", address.to_string(), what,
              ::dds_strretcode(code));
}

Result<Session> join(const Address& address) {
  static Domains domains;
  auto domain = domains.share(address);
  if (!domain) {
    return tl::unexpected{std::move(domain.error())};
  }
  Session session{
      .domain = std::move(*domain),
      .participant = Entity{::dds_create_participant(address.domain, nullptr, nullptr)}};
  if (!session.participant) {
    return refused(address, "DDS cannot be joined", session.participant.get());
  }
  return session;
}

Result<dds_entity_t> open_topic(const Session& session, const Address& address,
                                const dds_topic_descriptor_t& type) {
  const dds_entity_t topic =
      ::dds_create_topic(session.participant.get(), &type, address.topic.c_str(), nullptr, nullptr);
  if (topic < 0) {
    return refused(address, "is no topic", topic);
  }
  return topic;
}

}  // namespace geoflow::drivers::dds
