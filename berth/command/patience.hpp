/// Reading objects of one device: when to give up on a silent one, and the message.
#pragma once

#include "berth/base/result.hpp"
#include "berth/co/sdo_client.hpp"
#include "berth/command/objects.hpp"
#include "berth/command/reply.hpp"
#include "berth/operate/network.hpp"

namespace berth::command {

/// A device that has never answered is given up at once; one that has, after three objects in a row without an answer.
/// A refusal is an answer.
class Patience {
 public:
  /// Notes the result of one more object; true: give up.
  [[nodiscard]] bool over(const Result<co::SdoValue>& answer) noexcept {
    constexpr unsigned most = 3;
    const bool heard = answer || answer.error().code == Errc::aborted || answer.error().code == Errc::mismatch;
    silent_ = heard ? 0 : silent_ + 1;
    spoke_ = spoke_ || heard;
    return !heard && (!spoke_ || silent_ >= most);
  }

 private:
  unsigned silent_ = 0;
  bool spoke_ = false;
};

/// Advice on an SDO request without an answer; empty if its error says everything.
[[nodiscard]] std::string silence_fix(const Error& error, operate::Network& bus, const NodeArgument& node);

/// The message when it is over.
void fail_silent(Reply& reply, const Error& error, operate::Network& bus, const NodeArgument& node);

}  // namespace berth::command
