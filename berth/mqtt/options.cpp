#include "berth/mqtt/options.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace berth::mqtt {
namespace {

constexpr std::size_t longest_string = 65'535;  // MQTT 5.0 §1.5.4
constexpr std::size_t least_incoming = 1024;
constexpr unsigned most_unacknowledged = 20;  // libmosquitto's own limit

std::string of_limits(const Limits& limits, std::size_t subscriptions) {
  if (limits.incoming < least_incoming || limits.incoming > 0x0FFFFFFF)
    return "incoming packets are limited to 1024 to 268435455 bytes";
  if (limits.outgoing_messages == 0 || limits.outgoing_bytes == 0) return "there is no room for outgoing messages";
  if (limits.unacknowledged == 0 || limits.unacknowledged > most_unacknowledged)
    return "1 to 20 messages may wait for their acknowledgement";
  if (subscriptions > limits.subscriptions)
    return fmt::format("there are {} subscriptions, and at most {} are allowed", subscriptions, limits.subscriptions);
  return {};
}

}  // namespace

std::string complaint(const Options& options) {
  using std::chrono::seconds;
  if (options.where.host.empty()) return "the broker's address is missing";
  if (options.client_id.empty() || options.client_id.size() > longest_string)
    return "the client-ID has 1 to 65535 bytes";
  if (options.client_id.find('\0') != std::string::npos) return "the client-ID has a NUL character";
  if (options.keep_alive < seconds(5) || options.keep_alive > seconds(65'535))
    return "the keep-alive time is 5 to 65535 seconds";
  if (options.tls.certificate.empty() != options.tls.key.empty())
    return "a client's certificate and its key belong together: name both files";
  if (options.pauses.first.count() <= 0 || options.pauses.longest < options.pauses.first)
    return "the pauses between attempts grow from the first, above 0, to the longest";
  const auto wrong = std::ranges::find_if(options.subscriptions, [](const std::string& filter) {
    return filter.empty() || filter.size() > longest_string || filter.find('\0') != std::string::npos;
  });
  if (wrong != options.subscriptions.end()) return "a topic filter has 1 to 65535 bytes, and no NUL";
  return of_limits(options.limits, options.subscriptions.size());
}

}  // namespace berth::mqtt
