/// The threads on which edge nodes live: MQTT's, and one that hands over, keeps and publishes. One pair serves any
/// number of edge nodes.
#pragma once

#include <memory>
#include <string>
#include <tl/expected.hpp>

namespace berth::fleet {

class Hub;

class Thread {
 public:
  /// Errors as text: the system has no thread or no descriptors.
  [[nodiscard]] static tl::expected<std::unique_ptr<Thread>, std::string> start();
  /// Its edge nodes must have been destroyed. Joins.
  ~Thread();
  Thread(const Thread&) = delete;
  Thread& operator=(const Thread&) = delete;
  [[nodiscard]] Hub& hub() noexcept { return *hub_; }

 private:
  explicit Thread(std::unique_ptr<Hub> hub) noexcept;
  std::unique_ptr<Hub> hub_;
};

}  // namespace berth::fleet
