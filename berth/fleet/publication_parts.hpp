/// What Sparkplug publishes, as a message and as a will of MQTT. Internal to room `fleet`.
#pragma once

#include "berth/mqtt/client.hpp"
#include "berth/sparkplug/message.hpp"

namespace berth::fleet {

[[nodiscard]] mqtt::Will will_of(sparkplug::Publication publication);
[[nodiscard]] mqtt::Message message_of(sparkplug::Publication publication, mqtt::ConnectionNumber connection);

}  // namespace berth::fleet
