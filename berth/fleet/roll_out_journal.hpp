/// What a roll-out has done so far, in a file of JSON lines: the first says what is rolled out, each other one how one
/// machine ended. After a crash, or when a failed machine was mended, the same roll-out goes on from it.
#pragma once

#include <cstdint>
#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "berth/sparkplug/topic.hpp"

namespace berth::fleet {

class RollOutJournal {
 public:
  /// What is rolled out.
  struct What {
    std::string command{};
    std::string slot{};
    std::uint32_t crc = 0;  ///< CRC-32 of the file
    friend bool operator==(const What&, const What&) = default;
  };

  /// Reads `path`, or begins it if there is none. The error is for users: the file is no journal, or that of another
  /// roll-out; it cannot be read or written. A last line that a crash left unfinished does not count.
  [[nodiscard]] static tl::expected<RollOutJournal, std::string> open(std::string path, const What& what);
  /// One machine ended; synced to the disk. Empty, or what is wrong.
  [[nodiscard]] std::string add(const sparkplug::EdgeNodeId& machine, bool done, const std::string& words);
  /// The machines that have it.
  [[nodiscard]] const std::vector<sparkplug::EdgeNodeId>& done() const noexcept { return done_; }
  [[nodiscard]] const std::string& path() const noexcept { return path_; }

 private:
  [[nodiscard]] static tl::expected<RollOutJournal, std::string> begin(std::string path, const What& what);
  RollOutJournal(std::string path, std::vector<sparkplug::EdgeNodeId> done) noexcept
      : path_(std::move(path)), done_(std::move(done)) {}
  std::string path_;
  std::vector<sparkplug::EdgeNodeId> done_;
};

}  // namespace berth::fleet
