/// Errors for the programmer of an application: the error as code and numbers, and one sentence with the node, the
/// object and its name, what happened and what to do.
///
///     const auto speed = co_await node.read<std::int32_t>("Target velocity");
///     if (!speed) fmt::print("{}\n", speed.error().message);
///     // node 5, object 60FFh:00 "Target velocity": aborted by the device (0800 0022): ...
///
/// The codes:
/// - Errc::not_found: the description has no such object; a name that fits several objects is Errc::duplicate
/// - Errc::invalid: refused before the bus was used: C++ type, access type, limits, length. `detail` is the abort code
///   that the device would have answered, or 0
/// - Errc::aborted: the device refused; `detail` = abort code
/// - Errc::timeout: the request was on the wire and no answer came
/// - Errc::bus: a frame was never sent
/// - Errc::mismatch: an answer that does not fit the description or the protocol
/// - Errc::cancelled: the node or network object was destroyed, or the device booted meanwhile
/// - Errc::unsupported: see the call
#pragma once

#include <string>

#include "berth/base/ids.hpp"
#include "berth/base/result.hpp"

namespace berth::client {

struct Failure : Error {
  std::string message;
};

/// Has no conversion to `Result`: `Error` is the failure's base, so `fail(outcome.error())` makes one.
template <class T>
using Outcome = tl::expected<T, Failure>;

/// A failure with its own sentence: "node 5, object ...: `what`".
[[nodiscard]] Failure make_failure(const Error& error, const std::string& object, const std::string& what);
/// `object` is a `Names::label`; empty: no object.
[[nodiscard]] Failure make_failure(const Error& error, const std::string& object = {});

/// Errc::cancelled: the node's object was destroyed.
[[nodiscard]] Failure node_gone(NodeId id);

}  // namespace berth::client
