/// The state of a running search by identify ranges. Only its own sources include this.
#pragma once

#include <algorithm>
#include <array>
#include <utility>

#include "berth/discovery/busy.hpp"
#include "berth/discovery/by_name.hpp"
#include "berth/discovery/identify.hpp"

namespace berth::discovery {

inline constexpr rt::Duration identify_window = std::chrono::milliseconds(10);
inline constexpr std::int64_t identify_bits = 126;
inline constexpr std::uint64_t all_serials = std::uint64_t{1} << 32;
inline constexpr std::uint64_t first_width = 256;
inline constexpr std::uint64_t least_width = 16;
inline constexpr std::uint64_t widens = 8;  // factor, after silence
// Halves that were not asked because the other half was silent. After so many in a row the next one is asked, so that
// the search does not follow a question that a device lost down to the last bit.
inline constexpr unsigned most_assumed = 6;
inline constexpr unsigned most_back = 2;
inline constexpr unsigned most_unproven = 4;  // in a row, plus the retries
inline constexpr unsigned enough_alone = 3;
// A device with a small receive buffer loses some of six consecutive frames.
inline constexpr rt::Duration slow_inhibit = std::chrono::milliseconds(10);

/// Pauses between the frames of the master's requests, from `slow_down` until it is destroyed.
class Pauses {
 public:
  explicit Pauses(lss::Master& lss) : lss_(&lss), before_(lss.options()) {}
  ~Pauses() { lss_->set_options(before_); }
  Pauses(const Pauses&) = delete;
  Pauses& operator=(const Pauses&) = delete;
  void slow_down() {
    lss::MasterOptions slower = before_;
    slower.inhibit = std::max(slower.inhibit, slow_inhibit);
    lss_->set_options(slower);
  }

 private:
  lss::Master* lss_;
  lss::MasterOptions before_;
};

[[nodiscard]] inline Box box_of(const Kind& kind, std::uint64_t low, std::uint64_t end) noexcept {
  Box box{.serial_low = static_cast<std::uint32_t>(low), .serial_high = static_cast<std::uint32_t>(end - 1)};
  if (kind.revision) box.revision_low = box.revision_high = *kind.revision;
  return box;
}

// The way down to one device.
struct Identify::Descent {
  Box box;
  Box answered;                 // the last answered range: `box`, or one around it
  std::optional<Box> silent{};  // the last half that was assumed empty
  unsigned assumed = 0;         // consecutive halves that were not asked
  unsigned back = 0;            // times that the descent ended in silence since it last advanced

  void go_on(const Box& heard) noexcept {
    if (heard != answered) back = 0;
    box = answered = heard;
    assumed = 0;
  }
  // False: too many returns, or in haste. Then less haste comes first, because finding the same serial number again
  // takes long.
  bool go_back(const Run& run) noexcept;
};

struct Identify::Run {
  const Known& known;
  const Options& options;
  rt::Duration frame{0};
  Report report{};
  bool again = false;  // the slow pass
  std::size_t kind = 0;
  std::size_t kinds = 0;
  unsigned unproven = 0;  // in a row
  // How careful to be after haste failed. `wary`: patient until one device is left; its late answers are noticed within
  // a few questions. `most`: patient to the end.
  enum class Care : std::uint8_t { none, wary, most };
  Care care = Care::none;
  unsigned alone = 0;  // consecutive nested ranges that got one answer
  Haste haste{};
  rt::Time haste_until{};  // by then every device has processed the hasty questions
  bool slow = false;       // a remaining device answers later than the others suggest: wait for it at each question
  bool late_yes = false;   // the question before the last was answered late
  bool stopped = false;    // the time is over, or the observer stopped it
  bool no_blank = false;   // no device without a node-ID is left, and no other is wanted
  bool untrusted = false;  // a device answers every request
  std::optional<Box> left_at{};  // contains a device, and the search was stopped
  std::vector<R_SN> passed{};    // answered for, but not proven, in this pass

  [[nodiscard]] rt::Duration longest() const noexcept {
    return (options.window.count() > 0 ? options.window : identify_window) + frame + options.blocking;
  }
  [[nodiscard]] std::vector<R_SN> known_of(const Kind& kind_) const {
    std::vector<R_SN> result = passed;
    const auto add = [&](const LssAddress& a) {
      if (a.type() == kind_.type && (!kind_.revision || a.revision == *kind_.revision)) result.push_back(a.r_sn());
    };
    for (const auto& a : known.registered) add(a);
    for (const auto& a : known.equals) add(a);
    for (const auto& d : report.found) add(d.address);
    return result;
  }
  [[nodiscard]] std::uint64_t next_known(const Kind& kind_, std::uint64_t from) const {
    std::uint64_t next = all_serials;
    for (const R_SN& n : known_of(kind_)) {
      if (n.serial >= from) next = std::min<std::uint64_t>(next, n.serial);
    }
    return next;
  }
  [[nodiscard]] bool full() const noexcept { return report.found.size() >= options.most_devices; }
  [[nodiscard]] bool over() const noexcept { return stopped || no_blank || untrusted || full(); }
  void tell(std::uint64_t swept, std::size_t silent) const {
    if (options.observer == nullptr) return;
    options.observer->progress({.again = again,
                                .kind = kind,
                                .kinds = kinds,
                                .swept = static_cast<double>(swept) / static_cast<double>(all_serials),
                                .silent = silent,
                                .found = report.found.size()});
  }
  // Between two requests, with no device in configuration.
  void look_at_the_time(rt::Time now) {
    if (options.most_time.count() > 0 && now - report.began > options.most_time) stopped = true;
    if (options.observer != nullptr && !options.observer->goes_on()) stopped = true;
  }
  void more_care() {
    if (care == Care::none) haste.note(false);
    care = care == Care::none ? Care::wary : Care::most;
  }
  // A device was found.
  void less_care() {
    slow = false;
    if (care == Care::none) haste.note(true);
    care = haste.pays() ? Care::none : Care::wary;
  }
  void failed() {
    more_care();
    ++report.unproven;
    if (++unproven > options.retries + most_unproven) untrusted = true;
  }
};

inline bool Identify::Descent::go_back(const Run& run) noexcept {
  box = answered;
  silent.reset();
  assumed = 0;
  const bool by_revision = box.serial_low == box.serial_high;
  return (run.care != Run::Care::none || by_revision) && ++back <= most_back;
}

}  // namespace berth::discovery
