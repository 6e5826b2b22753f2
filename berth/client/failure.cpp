#include "berth/client/failure.hpp"

#include <fmt/format.h>

#include "berth/od/abort_code.hpp"

namespace berth::client {

namespace {

/// CiA's notation of an abort code: "0601 0002".
std::string code_text(std::uint32_t code) { return fmt::format("{:04X} {:04X}", code >> 16, code & 0xFFFFU); }

std::string happened(const Error& error) {
  const auto code = static_cast<od::AbortCode>(error.detail);
  switch (error.code) {
    case Errc::aborted: return fmt::format("aborted by the device: {} ({})", od::text(code), code_text(error.detail));
    case Errc::timeout: return fmt::format("{}: the request was on the wire, no node answered in time", error.text);
    default: break;
  }
  const char* const text = error.text != nullptr && *error.text != '\0' ? error.text : name(error.code);
  return error.detail != 0 ? fmt::format("{} ({})", text, code_text(error.detail)) : text;
}

}  // namespace

Failure make_failure(const Error& error, const std::string& object, const std::string& what) {
  std::string where = error.node != 0 ? fmt::format("node {}", error.node) : std::string();
  if (!object.empty()) where += (where.empty() ? "" : ", ") + object;
  Failure failure{error, {}};
  failure.message = where.empty() ? what : where + ": " + what;
  return failure;
}

Failure make_failure(const Error& error, const std::string& object) {
  return make_failure(error, object, happened(error));
}

Failure node_gone(NodeId id) {
  return make_failure(Error{.code = Errc::cancelled, .node = id.value(), .text = "the node's object was destroyed"});
}

}  // namespace berth::client
