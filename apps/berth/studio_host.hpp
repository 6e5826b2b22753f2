/// `berth up --studio`: pages for a browser during the main job (docs/api.md).
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "berth/command/reply.hpp"
#include "berth/rt/task.hpp"
#include "machine_run.hpp"

namespace berth::cli {

/// What is wrong with `--studio`, checked first: no HOST:PORT, or this berth was built without Studio.
[[nodiscard]] std::optional<Failure> studio_refused(const Options& options);

/// The request of `berth trace --ring`, at the control socket only. The reply is `{"text", "next", "end"}`: lines of a
/// candump log, the frame to continue from, and the frame after the newest.
inline constexpr const char* ring_verb = "ring";

/// The server of a machine run in real time.
class StudioHost {
 public:
  using Carry = std::function<rt::Task<void>(const command::Request& request, command::Reply& reply)>;
  /// The machine run must outlive it and have a loop. `control`: the control socket, beside which the token is kept.
  /// `fleet`: as in `studio::Options`.
  [[nodiscard]] static tl::expected<std::unique_ptr<StudioHost>, Failure> start(MachineRun& run, const Options& options,
                                                                                const std::string& control,
                                                                                const std::string& fleet, Carry carry);
  ~StudioHost();
  StudioHost(const StudioHost&) = delete;
  StudioHost& operator=(const StudioHost&) = delete;
  /// This program has Studio with its pages.
  [[nodiscard]] static bool has_pages() noexcept;
  /// "Berth Studio at http://...", and a line for each requested role.
  [[nodiscard]] std::vector<std::string> lines() const;
  /// Its address without a token.
  [[nodiscard]] std::string page() const;
  void event(const operate::Event& event);
  /// Call it between two turns of the loop.
  void look();
  /// `ring_verb`: from frame "from" on, a part of the frames that match "filter".
  [[nodiscard]] command::Reply ring(const command::Request& request) const;

 private:
  class Impl;
  explicit StudioHost(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace berth::cli
