/// The doctor's questions, if allowed: LSS, and with `intrusive` SDO.
///
///     Answers answers;                                          // all must outlive the task
///     auto done = co_await ask(dispatcher, ear, expected, options, answers);
///
/// LSS questions without selection (identify) disturb nothing, whichever master asks. Selecting devices and inquiring
/// their node-IDs does: another LSS master at work could configure two devices at once. So this is omitted if another
/// master's requests were heard. SDO disturbs another SDO client of the same server (CiA 301 has one default channel),
/// and is used only at a user's request.
#pragma once

#include "berth/base/result.hpp"
#include "berth/doctor/diagnose.hpp"
#include "berth/rt/task.hpp"

namespace berth::doctor {

struct QuestionOptions {
  rt::Duration lss_timeout = std::chrono::milliseconds(100);     ///< answer to an LSS request
  rt::Duration identify_window = std::chrono::milliseconds(30);  ///< silence that counts as an answer to identify
  rt::Duration sdo_timeout = std::chrono::milliseconds(200);     ///< window for all answers to one SDO request
  bool intrusive = false;
  unsigned most_devices = 64;  ///< of one type
};

/// Asks; the answers so far are in `answers`, even after an error. Finds devices of the slots' types by halving the
/// range of serial numbers, with or without node-IDs (S4.21: Fastscan finds only those without). Errors: `bus` a
/// request could not be sent.
[[nodiscard]] rt::Task<Result<void>> ask(can::Dispatcher& dispatcher, Ear& ear, const Expected& expected,
                                         const QuestionOptions& options, Answers& answers);

}  // namespace berth::doctor
