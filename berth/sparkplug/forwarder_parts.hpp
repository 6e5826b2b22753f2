// What of an edge node's changes is not proven to be delivered: the backlog with a cursor in it, and what was published
// live since the broker's last answer. Internal to `EdgeNode`.
#pragma once

#include <deque>
#include <functional>
#include <set>

#include "berth/sparkplug/backlog.hpp"

namespace berth::sparkplug {

class Forwarder {
 public:
  explicit Forwarder(Backlog& backlog, std::size_t most_unproven) : backlog_(&backlog), most_unproven_(most_unproven) {}

  /// Into the backlog, or counted as lost.
  void keep(const Kept& change);
  /// Whether an entry can be sent in this session.
  enum class Fate : std::uint8_t { send, wait, never };
  using Judge = std::function<Fate(const Kept&)>;
  /// The next entries that can be sent. Those that never can (their metric is gone) are dropped and counted as lost.
  [[nodiscard]] std::vector<Backlog::Entry> portion(std::size_t most, const Judge& judge);
  /// The entry was published with the message of this mark.
  void sent(std::uint64_t mark, std::uint64_t id);
  /// The change was published live with the message of this mark.
  void live(std::uint64_t mark, Kept change);
  /// The broker has all messages up to `mark`.
  void answered(std::uint64_t mark);
  /// The session is over: what is unproven goes into the backlog, and forwarding begins anew.
  void broken();
  /// Entries that had to wait may be sendable now.
  void rewind() noexcept {
    cursor_ = 0;
    more_ = true;
  }

  [[nodiscard]] bool unproven() const noexcept { return !live_.empty() || !sent_.empty(); }
  /// The cursor has not yet passed all entries.
  [[nodiscard]] bool more() const noexcept { return more_ && backlog_->size() > sent_.size(); }
  [[nodiscard]] std::uint64_t lost() const noexcept { return lost_; }
  /// Changes of this device (of all its metrics) are given up.
  void give_up(const std::string& device);

 private:
  struct Sent {
    std::uint64_t mark;
    std::uint64_t id;
  };
  struct Live {
    std::uint64_t mark;
    Kept change;
  };
  Backlog* backlog_;
  std::size_t most_unproven_;
  std::deque<Sent> sent_;
  std::set<std::uint64_t> in_flight_;  // the IDs of `sent_`
  std::deque<Live> live_;
  std::uint64_t cursor_ = 0;
  std::uint64_t lost_ = 0;
  bool more_ = true;
};

}  // namespace berth::sparkplug
