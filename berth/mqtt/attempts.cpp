#include "berth/mqtt/attempts.hpp"

namespace berth::mqtt {
namespace {

Version other(Version version) noexcept { return version == Version::v5 ? Version::v3_1_1 : Version::v5; }

}  // namespace

Attempts::Attempts(const Options& options, Random random) noexcept
    : automatic_(options.version == Version::automatic),
      version_(automatic_ ? Version::v5 : options.version),
      backoff_(options.pauses, random) {}

const std::string& Attempts::address(const std::vector<std::string>& found) noexcept {
  addresses_ = found.size();
  if (address_ >= addresses_) address_ = 0;
  return found[address_];
}

// The system sorts addresses by what it knows of its own network: whether anybody listens there, it does not.
bool Attempts::other_address(const Cause& cause, Stage stage) noexcept {
  if (stage == Stage::connected) return false;
  if (cause.why != Why::refused && cause.why != Why::unreachable && cause.why != Why::no_answer) return false;
  if (++address_ < addresses_) return true;
  address_ = 0;
  return false;
}

// A broker that does not know 5 should answer so (3.1.1 §3.1.2.2), but some only close the connection. That may have
// other reasons, so then the other version is tried in its turn.
bool Attempts::other_version(const Cause& cause, Stage stage) noexcept {
  if (stage == Stage::connected) settled_ = true;
  if (!automatic_ || stage != Stage::asked) return false;
  if (cause.why == Why::version_refused) {
    const bool at_once = version_ == Version::v5;
    version_ = other(version_);
    settled_ = true;
    return at_once;
  }
  if (!settled_ && (cause.why == Why::closed || cause.why == Why::protocol)) version_ = other(version_);
  return false;
}

Milliseconds Attempts::after(const Cause& cause, Stage stage, Milliseconds lasted) noexcept {
  if (other_address(cause, stage) || other_version(cause, stage)) return Milliseconds(0);
  if (cause.why == Why::taken_over) return backoff_.longest();
  if (stage == Stage::connected) backoff_.after(lasted);
  return backoff_.next();
}

}  // namespace berth::mqtt
