/// SIGHUP of a service manager: `berth up` reads its machine file anew while the machine runs.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "berth/base/bell.hpp"
#include "berth/design/differences.hpp"
#include "machine_run.hpp"

namespace berth::cli {

/// What a new text of the machine file changes: some keys of slots are taken over, all others wait for the next start.
struct Changes {
  std::vector<design::Difference> taken;
  std::vector<design::Difference> refused;
};
/// `start`: the text with which the run began. `last`: the one that was read last.
[[nodiscard]] Changes changes_of(const text::Value& start, const text::Value& last, const text::Value& now);

/// Reads in a thread of its own: the bus does not wait for a disk. A file with an error changes nothing.
class Reload final : private io::Watcher {
 public:
  using Say = std::function<void(const std::string& line)>;
  /// The text of a machine file, for `start`; empty if it cannot be read.
  [[nodiscard]] static std::optional<std::string> text_of(const std::string& machine_file);
  /// `run` has a loop, and all of these outlive this. `ended` is called after each reading.
  Reload(MachineRun& run, std::vector<std::string> allow_outside, const std::string& start, Say say,
         std::function<void()> ended);
  ~Reload();
  Reload(const Reload&) = delete;
  Reload& operator=(const Reload&) = delete;
  /// While a reading is under way: once more after it.
  void begin();

 private:
  struct Reading {
    std::optional<std::string> text;
    design::MachineResult result;
  };
  void ready(std::uint32_t events) noexcept override;
  void take(const Reading& reading);
  void say_all(const Changes& changes);

  MachineRun& run_;
  std::vector<std::string> allow_outside_;
  std::optional<text::Value> start_;
  std::optional<text::Value> last_;
  Say say_;
  std::function<void()> ended_;
  Bell bell_;
  Reading read_;          // written by the thread until it rings
  std::jthread reading_;  // after what it writes
  bool under_way_ = false;
  bool once_more_ = false;
};

}  // namespace berth::cli
