/// Frames that are kept: in the file of `--record`, and for what a dry run prints.
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

/// One frame that was on a bus, or would be.
struct Recorded {
  std::optional<double> at_s;  ///< none: when is not known
  std::string bus;
  std::string frame;
  bool by_master = false;
};

/// "(0000000000.215000) field 7E5#0400000000000000"; the frame alone when its time is not known.
[[nodiscard]] std::string candump_line(const Recorded& frame);

/// What a dry run says: the frames and, of a command, what came of it in the world that is thrown away; `reply` may be
/// null.
void print_dry_run(const std::vector<Recorded>& frames, const command::Reply* reply, bool json);

/// Takes the frames of all buses as they come. While the file takes nothing (a full disk), it keeps up to 1 MiB of
/// lines and tries again ten times a second, so that the record goes on when there is room; what comes beyond that is
/// counted. The file has whole lines only.
class Record {
 public:
  Record() = default;
  ~Record();
  Record(const Record&) = delete;
  Record& operator=(const Record&) = delete;

  /// A line for each frame from now on, as candump -L writes it.
  [[nodiscard]] tl::expected<void, Failure> write_to(const std::string& path, bool force);
  /// Keeps the frames that Berth sends from now on.
  void collect_sent(std::vector<Recorded>& into) { sent_ = &into; }
  /// Gives each frame's line to `take` from now on, while `wanted`; empty functions end that.
  void follow(std::function<bool()> wanted, std::function<void(const std::string& line)> take);
  /// Gives each frame to `take` as well; empty: no more.
  using Take = std::function<void(const std::string& bus, const can::Frame& frame, rt::Time at, bool by_master)>;
  void on_frame(Take take) { frames_ = std::move(take); }
  /// Gives each frame that Berth sends to `take`.
  void on_sent(Take take) { own_ = std::move(take); }
  void frame(const std::string& bus, const can::Frame& frame, rt::Time at, bool by_master);
  /// Gives each error on a bus to `take` (can/bus_error.hpp), with what is known of it beside; empty: no more.
  using TakeError =
      std::function<void(const std::string& bus, const can::Frame& report, rt::Time at, const std::string& words)>;
  void on_error(TakeError take) { errors_ = std::move(take); }
  void error(const std::string& bus, const can::Frame& report, rt::Time at, const std::string& words) {
    if (errors_) errors_(bus, report, at, words);
  }
  [[nodiscard]] bool takes_errors() const noexcept { return static_cast<bool>(errors_); }
  /// Frames that came, ever.
  [[nodiscard]] std::uint64_t seen() const noexcept { return seen_; }
  /// Takes, once, that the file takes nothing: what, where, what to do. Empty: standard error, as at the beginning.
  void on_trouble(std::function<void(const std::string& line)> tell) { tell_ = std::move(tell); }
  /// What came is in the file, so that it can be followed.
  void settle();
  /// Last thing of a command: `status`, or 3 when frames are missing in the file, which is told with their number.
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
  Take own_;
  TakeError errors_;
  std::uint64_t seen_ = 0;
  std::string path_;
  int log_ = -1;
  std::string lines_;          // that are not in the file yet
  std::uint64_t missing_ = 0;  // frames that came while there were too many of them
  std::chrono::steady_clock::time_point written_{};
  int error_ = 0;  // of the last writing
  bool told_ = false;
};

/// Records every frame of one simulated bus. Both must stay.
class BusTap final : public can::Tap {
 public:
  /// `master`: the number of Berth's own controller there.
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
