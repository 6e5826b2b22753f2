/// Reading objects of one device: how long silence is borne, and what is said of it.
#pragma once

#include "berth/base/result.hpp"
#include "berth/co/sdo_client.hpp"
#include "berth/command/objects.hpp"
#include "berth/command/reply.hpp"
#include "berth/operate/network.hpp"

namespace berth::command {

/// A device that has answered nothing yet is given up at once, one that has answered at the third object in a row
/// without an answer. A refusal is an answer.
class Patience {
 public:
  /// Notes what came of one more object; true: it is over.
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

/// What to do about an SDO request that was not answered; empty where its error says all.
[[nodiscard]] std::string silence_fix(const Error& error, operate::Network& bus, const NodeArgument& node);

/// What is said when it is over.
void fail_silent(Reply& reply, const Error& error, operate::Network& bus, const NodeArgument& node);

}  // namespace berth::command
