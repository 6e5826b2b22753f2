/// Keeps frames: for the file of `--record`, and for the output of a dry run.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <tl/expected.hpp>
#include <utility>
#include <vector>

#include "berth/can/port.hpp"
#include "berth/command/reply.hpp"
#include "berth/sim/bus.hpp"
#include "output.hpp"

namespace berth::cli {

/// One frame that was, or would be, on a bus.
struct Recorded {
  std::optional<double> at_s;  ///< none: time unknown
  std::string bus;
  std::string frame;
  bool by_master = false;
};

/// "(0000000000.215000) field 7E5#0400000000000000"; only the frame if its time is unknown.
[[nodiscard]] std::string candump_line(const Recorded& frame);

/// Prints the output of a dry run: the frames and, for a command, its result in the discarded world; `reply` may be
/// null.
void print_dry_run(const std::vector<Recorded>& frames, const command::Reply* reply, bool json);

/// Takes the frames of all buses as they come. While the file cannot be written (a full disk), it keeps up to 1 MiB of
/// lines and retries ten times a second, so that the record goes on when there is room; it counts the frames beyond
/// that. The file has whole lines only.
class Record {
 public:
  Record() = default;
  ~Record();
  Record(const Record&) = delete;
  Record& operator=(const Record&) = delete;

  /// From now on writes a line for each frame, as candump -L does.
  [[nodiscard]] tl::expected<void, Failure> write_to(const std::string& path, bool force);
  /// From now on keeps the frames that Berth sends.
  void collect_sent(std::vector<Recorded>& into) { sent_ = &into; }
  /// From now on gives each frame's line to `take` while `wanted`; empty functions end that.
  void follow(std::function<bool()> wanted, std::function<void(const std::string& line)> take);
  /// Gives each frame to `take` as well; empty ends that.
  using Take = std::function<void(const std::string& bus, const can::Frame& frame, rt::Time at, bool by_master)>;
  void on_frame(Take take) { frames_ = std::move(take); }
  /// The same for a second one.
  void also_on_frame(Take take) { more_frames_ = std::move(take); }
  /// Gives each frame that Berth sends to `take`.
  void on_sent(Take take) { own_ = std::move(take); }
  void frame(const std::string& bus, const can::Frame& frame, rt::Time at, bool by_master);
  /// Gives each error on a bus to `take` (can/bus_error.hpp), with details beside it; empty ends that.
  using TakeError =
      std::function<void(const std::string& bus, const can::Frame& report, rt::Time at, const std::string& words)>;
  void on_error(TakeError take) { errors_ = std::move(take); }
  void error(const std::string& bus, const can::Frame& report, rt::Time at, const std::string& words) {
    if (errors_) errors_(bus, report, at, words);
  }
  [[nodiscard]] bool takes_errors() const noexcept { return static_cast<bool>(errors_); }
  /// Number of frames so far.
  [[nodiscard]] std::uint64_t seen() const noexcept { return seen_; }
  /// Gets one message when the file cannot be written: what, where, what to do. Empty: standard error, which is the
  /// default.
  void on_trouble(std::function<void(const std::string& line)> tell) { tell_ = std::move(tell); }
  /// Writes everything so far to the file, so that it can be followed.
  void settle();
  /// Call it last in a command: returns `status`, or 3 when the file lacks frames; it reports how many.
  [[nodiscard]] int finish(int status);

 private:
  void add(const std::string& line);
  void write_out();
  [[nodiscard]] std::size_t put() noexcept;
  [[nodiscard]] bool take_back(std::size_t bytes) const noexcept;
  void tell_trouble();

  std::vector<Recorded>* sent_ = nullptr;
  std::function<bool()> wanted_;
  std::function<void(const std::string&)> take_;
  std::function<void(const std::string&)> tell_;
  Take frames_;
  Take more_frames_;
  Take own_;
  TakeError errors_;
  std::uint64_t seen_ = 0;
  std::string path_;
  int log_ = -1;
  std::string lines_;          // not in the file yet
  std::uint64_t missing_ = 0;  // frames dropped when too many lines waited
  std::chrono::steady_clock::time_point written_{};
  int error_ = 0;  // of the last write
  bool told_ = false;
};

/// Records every frame of one simulated bus. Both must outlive it.
class BusTap final : public can::Tap {
 public:
  /// `master`: the number of Berth's controller there.
  BusTap(Record& record, sim::Bus& bus, int master) : record_(&record), bus_(&bus), master_(master) {
    bus_->add_tap(*this);
  }
  ~BusTap() { bus_->remove_tap(*this); }
  BusTap(const BusTap&) = delete;
  BusTap& operator=(const BusTap&) = delete;
  void frame(const can::Frame& frame, rt::Time at, int sender) noexcept override {
    record_->frame(bus_->name(), frame, at, sender == master_);
  }
  void error(const can::BusError& error, rt::Time at) noexcept override {
    if (record_->takes_errors()) record_->error(bus_->name(), error.report, at, words_of(error));
  }

 private:
  /// "signalled first by left and 2 others; right sent 185h"
  [[nodiscard]] std::string words_of(const can::BusError& error) const;

  Record* record_;
  sim::Bus* bus_;
  int master_;
};

}  // namespace berth::cli
