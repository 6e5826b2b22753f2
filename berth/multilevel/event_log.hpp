/// The event log of a whole machine, kept by the system master on the backbone (docs/multilevel.md §EMCY): every
/// emergency with the path of its producer, and which errors are pending where. Paper 3 Figure 10: the producer's
/// device profile gives the code's meaning, because profiles use the same codes differently.
#pragma once

#include <deque>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "berth/can/dispatcher.hpp"
#include "berth/co/emcy.hpp"
#include "berth/multilevel/emcy_layout.hpp"

namespace berth::multilevel {

struct LoggedEmcy {
  rt::Time at{};
  EmcyReading reading;
  std::uint16_t profile = 0;  ///< of the producer; 0: none, or unknown
};

/// Words for a code of a device of a profile, such as `decode::emcy_words`. Never null.
using EmcyWords = const char* (*)(std::uint16_t code, std::uint16_t profile);
/// "3/4/5: 8130h life guard or heartbeat error", "3/5: error 2310h gone: current at the output". With port and signal,
/// if given.
[[nodiscard]] std::string text(const LoggedEmcy& entry, EmcyWords words);

class EventLog final : private co::EmcyConsumer::Observer {
 public:
  /// Keeps the newest `most` entries. Hears nothing yet.
  EventLog(can::Dispatcher& backbone, EmcyLayout layout, std::size_t most = 10'000);
  void hear_all() { consumer_.hear_all(); }
  void hear(NodeId node, co::CobId id) { consumer_.hear(node, id); }
  /// Sets the lower word of 1000h of the node with this path.
  void set_profile(const std::vector<NodeId>& path, std::uint16_t profile) { profiles_[path] = profile; }
  void on_event(std::function<void(const LoggedEmcy&)> call) { told_ = std::move(call); }

  [[nodiscard]] const std::deque<LoggedEmcy>& entries() const noexcept { return entries_; }
  /// All messages so far, including those no longer kept.
  [[nodiscard]] std::uint64_t count() const noexcept { return count_; }
  /// Codes of the pending errors of a node, oldest first.
  [[nodiscard]] std::vector<std::uint16_t> pending(const std::vector<NodeId>& path) const;

 private:
  void emergency(NodeId node, const co::Emcy& message, rt::Time at) noexcept override;
  void note(const EmcyReading& reading);

  co::EmcyConsumer consumer_;
  EmcyLayout layout_;
  std::size_t most_;
  std::deque<LoggedEmcy> entries_;
  std::uint64_t count_ = 0;
  std::map<std::vector<NodeId>, std::uint16_t> profiles_;
  std::map<std::vector<NodeId>, std::vector<std::uint16_t>> pending_;
  std::function<void(const LoggedEmcy&)> told_;
};

}  // namespace berth::multilevel
