#include "berth/base/result.hpp"

#include <fmt/format.h>

namespace berth {

const char* name(Errc code) noexcept {
  switch (code) {
    case Errc::timeout: return "timeout";
    case Errc::aborted: return "aborted";
    case Errc::mismatch: return "mismatch";
    case Errc::duplicate: return "duplicate";
    case Errc::not_found: return "not found";
    case Errc::invalid: return "invalid";
    case Errc::exhausted: return "exhausted";
    case Errc::bus: return "bus";
    case Errc::io: return "io";
    case Errc::cancelled: return "cancelled";
    case Errc::unsupported: return "unsupported";
  }
  return "unknown";
}

std::string describe(const Error& error) {
  std::string out;
  if (error.node != 0) out += fmt::format("node {}", error.node);
  if (error.index != 0) {
    out += fmt::format("{}object {:04X}h:{:02X}", out.empty() ? "" : ", ", error.index, error.sub);
  }
  if (!out.empty()) out += ": ";
  out += name(error.code);
  if (error.detail != 0) out += fmt::format(" ({:08X}h)", error.detail);
  if (error.text != nullptr && *error.text != '\0') out += fmt::format(": {}", error.text);
  return out;
}

}  // namespace berth
