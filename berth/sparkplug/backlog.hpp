/// Store and forward: changes that nobody could get yet, kept until they are delivered.
#pragma once

#include <map>
#include <span>
#include <string>
#include <vector>

#include "berth/sparkplug/payload.hpp"

namespace berth::sparkplug {

/// One change of one metric. By name: aliases may differ after a restart.
struct Kept {
  std::string device;  ///< empty: a metric of the edge node itself
  std::string metric;
  DataType type = DataType::unknown;
  Value value;
  Utc at;
  Quality quality = Quality::good;
  friend bool operator==(const Kept&, const Kept&) = default;
};

/// Where changes are kept, in memory or on disk; implemented by the owner. What `append` took is a promise: it stays,
/// over a restart if the implementation says so, until `drop`.
class Backlog {
 public:
  struct Entry {
    std::uint64_t id = 0;
    Kept kept;
  };
  /// False: full, or the disk is. The change is then not promised; `EdgeNode` counts it. The newest is refused rather
  /// than the oldest thrown out, which was promised; the metric's current value is in the next birth anyway.
  [[nodiscard]] virtual bool append(const Kept& change) = 0;
  /// At most `most` entries with an ID above `id` (IDs are above 0), in the order of appending, which is that of
  /// IDs.
  [[nodiscard]] virtual std::vector<Entry> after(std::uint64_t id, std::size_t most) const = 0;
  /// They are delivered. IDs that are not there are ignored.
  virtual void drop(std::span<const std::uint64_t> ids) = 0;
  [[nodiscard]] virtual std::size_t size() const = 0;

 protected:
  ~Backlog() = default;
};

/// A backlog that ends with the process.
class MemoryBacklog final : public Backlog {
 public:
  struct Limits {
    std::size_t entries = 100'000;
    std::size_t bytes = 16 * 1024 * 1024;  ///< of texts and values, about
  };
  MemoryBacklog() = default;
  explicit MemoryBacklog(const Limits& limits) : limits_(limits) {}
  [[nodiscard]] bool append(const Kept& change) override;
  [[nodiscard]] std::vector<Entry> after(std::uint64_t id, std::size_t most) const override;
  void drop(std::span<const std::uint64_t> ids) override;
  [[nodiscard]] std::size_t size() const override { return entries_.size(); }

 private:
  Limits limits_{};
  std::map<std::uint64_t, Kept> entries_;
  std::size_t bytes_ = 0;
  std::uint64_t last_ = 0;
};

}  // namespace berth::sparkplug
