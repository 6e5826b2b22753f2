#include <utility>

#include "berth/fleet/publication_parts.hpp"

namespace berth::fleet {
namespace {

mqtt::Qos qos_of(const sparkplug::Publication& publication) noexcept {
  return publication.qos == 0 ? mqtt::Qos::at_most_once : mqtt::Qos::at_least_once;
}

}  // namespace

mqtt::Will will_of(sparkplug::Publication publication) {
  return {.topic = std::move(publication.topic),
          .payload = std::move(publication.bytes),
          .qos = qos_of(publication),
          .retain = publication.retain};
}

mqtt::Message message_of(sparkplug::Publication publication, mqtt::ConnectionNumber connection) {
  return {.connection = connection,
          .topic = std::move(publication.topic),
          .payload = std::move(publication.bytes),
          .qos = qos_of(publication),
          .retain = publication.retain};
}

}  // namespace berth::fleet
