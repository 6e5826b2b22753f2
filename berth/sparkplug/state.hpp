/// STATE messages of host applications (Sparkplug 3.0 §4.2.3): JSON, not the payload of the other messages.
#pragma once

#include <optional>
#include <span>

#include "berth/sparkplug/payload.hpp"

namespace berth::sparkplug {

struct HostState {
  bool online = false;
  Utc at;  ///< when the host's session began; of a clean end, when it ended
  friend bool operator==(const HostState&, const HostState&) = default;
};

/// `{"online":true,"timestamp":1670000000000}`
[[nodiscard]] Bytes encode_state(const HostState& state);

/// `invalid`, with the reason: no JSON object of at most 4 KiB with a boolean "online" and a number "timestamp" of
/// whole milliseconds (also the plain words of Sparkplug 2.2). Other keys are ignored.
[[nodiscard]] Result<HostState> decode_state(std::span<const std::uint8_t> bytes);

/// What an edge node knows of its primary host application. A message older than the last one that counted is ignored:
/// it is the will of a session that has a successor.
///
/// If the host's clock was set back, its new messages are older and the standard's rule ignores them as well, until the
/// clock has passed the old time. `forget` is for the person who knows.
class PrimaryHost {
 public:
  enum class Heard : std::uint8_t { online, offline, older };
  Heard take(const HostState& state) noexcept;
  /// Said of this connection; a new one must hear it again.
  [[nodiscard]] bool online() const noexcept { return online_; }
  void reconnected() noexcept { online_ = false; }
  void forget() noexcept { last_.reset(); }
  [[nodiscard]] std::optional<Utc> last() const noexcept { return last_; }

 private:
  std::optional<Utc> last_;
  bool online_ = false;
};

}  // namespace berth::sparkplug
