/// Values of the machine file's `watch =`, read while a live table is shown.
#pragma once

#include <string>
#include <vector>

#include "berth/rt/scope.hpp"
#include "berth/tree/session.hpp"
#include "watched.hpp"

namespace berth::cli {

class LiveValues {
 public:
  /// Reads all values once per `every`, by `sdo read`, of operational slots only: a booting device is left alone.
  /// `session` must outlive it.
  LiveValues(tree::Session& session, Watched watched, rt::Duration every = std::chrono::seconds(1));
  ~LiveValues() { scope_.cancel(); }
  LiveValues(const LiveValues&) = delete;
  LiveValues& operator=(const LiveValues&) = delete;

  [[nodiscard]] const std::vector<WatchRow>& rows() const noexcept { return watched_.rows(); }

 private:
  [[nodiscard]] rt::Task<void> run();
  [[nodiscard]] std::string why_not(std::size_t request) const;

  tree::Session* session_;
  Watched watched_;
  rt::Duration every_;
  command::Request request_;  // the one in progress
  command::Reply reply_;
  rt::Scope scope_;
};

/// "left/1001h" for each value that the machine file names.
[[nodiscard]] std::vector<std::string> watch_words(const design::Machine& machine);

}  // namespace berth::cli
