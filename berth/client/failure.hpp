/// What went wrong, told to the programmer of an application: the error as code and numbers, and one sentence that says
/// node, object with its name, what happened and what to do.
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
/// - Errc::bus: a frame never left
/// - Errc::mismatch: an answer, and not one that fits the description or the protocol
/// - Errc::cancelled: the node or network object is gone, or the device booted in the middle
/// - Errc::unsupported: see the call
#pragma once

#include <string>

#include "berth/base/ids.hpp"
#include "berth/base/result.hpp"

namespace berth::client {

struct Failure : Error {
  std::string message;
};

/// Converts to nothing by itself: `Error` is the failure's base, so `fail(outcome.error())` makes a `Result` of it.
template <class T>
using Outcome = tl::expected<T, Failure>;

/// A failure with a sentence of its own: "node 5, object ...: `what`".
[[nodiscard]] Failure make_failure(const Error& error, const std::string& object, const std::string& what);
/// `object` is what `Names::label` gives; empty: no object is concerned.
[[nodiscard]] Failure make_failure(const Error& error, const std::string& object = {});

/// Errc::cancelled: the node's object was destroyed.
[[nodiscard]] Failure node_gone(NodeId id);

}  // namespace berth::client
