/// How the LSS slaves of known stacks differ from CiA 305, for simulated devices that behave like them. Works before
/// `lss::Slave`: blocks its requests, answers in its place, or lets it work.
///
/// canopennode (CANopenNode 4.0 and 4.1, `305/CO_LSSslave.c`, without its option to answer Fastscan at once):
/// - answers from its main loop: a little later, and `busy_per_million` times in a million `busy_min` to `busy_max`
///   later. Until then it ignores further requests, `04 00` included
/// - in configuration every 51h is answered 4Fh and every 43h 44h, whatever the content; 40h to 42h have no answer
///   - 46h to 4Bh and 4Ch are never answered
/// - 40h to 42h count in any order, until the next `04 00` or power-on: 43h compares all four
/// - Fastscan: part and next part above 3 are refused; a scan is complete when bit 0 was asked with a next part below
///   the asked one
/// - 5Eh returns the active node-ID, thus 255 even when another is pending
/// lely (Lely core 2.3 and its development of December 2023, `src/co/lss.c`, `src/co/nmt.c`):
/// - a device with a node-ID also answers Fastscan, and complete is as above; a next part above 3 silences it until the
///   next 80h or switch global
/// - in configuration 40h to 43h and 51h have no answer, as CiA 305's state table requires; 46h to 4Ch have
/// - a device that got its first node-ID does not boot at `04 00`, but when NMT resets node-ID 255, or all
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "berth/base/random.hpp"
#include "berth/lss/answer_queue.hpp"
#include "berth/lss/slave.hpp"

namespace berth::device {

enum class LssHabit : std::uint8_t { none, canopennode, lely };

class LssHabits final : private rt::Job {
 public:
  static constexpr rt::Duration loop = std::chrono::milliseconds(1);  ///< one pass of a main loop that is not busy
  static constexpr std::uint32_t busy_per_million = 20'000;
  static constexpr rt::Duration busy_min = std::chrono::milliseconds(10);
  static constexpr rt::Duration busy_max = std::chrono::milliseconds(40);

  /// `answers` receives the late answers.
  LssHabits(LssHabit habit, rt::Executor& executor, lss::AnswerQueue& answers, std::uint64_t seed) noexcept
      : habit_(habit), executor_(&executor), answers_(&answers), random_(seed) {}

  /// Replaces `Slave::handle`.
  lss::Answers handle(const can::Frame& frame, lss::Slave& slave) noexcept;
  /// The device restarts or loses power: forgets what waits.
  void reset() noexcept;
  /// `04 00` does not end initialising; only NMT for node-ID 255 does.
  [[nodiscard]] bool boots_by_nmt() const noexcept { return habit_ == LssHabit::lely; }

 private:
  using Answer = std::optional<can::Frame>;
  lss::Answers like_canopennode(const can::Frame& frame, lss::Slave& slave) noexcept;
  lss::Answers like_lely(const can::Frame& frame, lss::Slave& slave) noexcept;
  Answer selected(const can::Frame& frame, lss::Slave& slave) noexcept;
  Answer fastscan(const can::Frame& frame, lss::Slave& slave) noexcept;
  Answer identified(const can::Frame& frame, const lss::Slave& slave) noexcept;
  void run() noexcept override;

  LssHabit habit_;
  rt::Executor* executor_;
  lss::AnswerQueue* answers_;
  Random random_;
  lss::Answers late_{};
  std::array<std::uint32_t, 4> asked_for_{};  // canopennode: by 40h to 43h
  std::uint8_t part_ = 0;                     // Fastscan: the next part to be asked
  std::uint8_t identified_ = 0;               // lely: frames of 46h to 4Bh that matched in order
  bool waits_ = false;                        // canopennode: waits for its main loop
};

}  // namespace berth::device
