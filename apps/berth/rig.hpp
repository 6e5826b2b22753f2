/// A machine, the simulated world it runs on, its store and the session, put together from files.
#pragma once

#include <cstdio>
#include <memory>
#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <vector>

#include "berth/design/machine.hpp"
#include "berth/io/loop.hpp"
#include "berth/operate/session.hpp"
#include "berth/plant/world.hpp"
#include "options.hpp"
#include "output.hpp"

namespace berth::cli {

/// What a person gives: file names, or the texts that `berth demo` has built in.
struct Sources {
  std::string machine_name;
  std::string plant_name;
  std::string_view machine_text;  ///< empty: the files are read
  std::string_view plant_text;
};

/// One frame that was on a bus.
struct Recorded {
  double at_s = 0;
  std::string bus;
  std::string frame;
  bool by_master = false;
};

class Rig {
 public:
  using Made = tl::expected<std::unique_ptr<Rig>, Failure>;
  /// Opens the session. With `options.dry_run` nothing outside this process changes: the store is a copy.
  [[nodiscard]] static Made make(const Options& options, const Sources& sources);
  ~Rig();
  Rig(const Rig&) = delete;
  Rig& operator=(const Rig&) = delete;

  [[nodiscard]] const design::Machine& machine() const noexcept { return machine_; }
  [[nodiscard]] const plant::PlantFile& plant() const noexcept { return plant_; }
  [[nodiscard]] plant::World& world() noexcept { return *world_; }
  [[nodiscard]] operate::Session& session() noexcept { return *session_; }
  /// The buses are in another process (`berth plant`): real time only, and the world has no bus. Null: simulated here.
  [[nodiscard]] io::Loop* loop() noexcept { return loop_.get(); }
  /// Keeps the frames that Berth sends from now on.
  void record_sent(std::vector<Recorded>& into) { sent_ = &into; }
  /// False when a line of `--record` could not be written.
  [[nodiscard]] bool record_kept() noexcept { return !log_failed_ && (log_ == nullptr || std::fflush(log_) == 0); }

 private:
  class BusTap;
  Rig() = default;
  [[nodiscard]] tl::expected<void, Failure> read(const Options& options, const Sources& sources);
  [[nodiscard]] tl::expected<std::unique_ptr<can::Port>, Failure> attach(const design::Bus& bus,
                                                                         const Options& options);
  [[nodiscard]] tl::expected<void, Failure> build_world(const Options& options);
  [[nodiscard]] tl::expected<void, Failure> open_store(const Options& options);
  [[nodiscard]] tl::expected<void, Failure> open_session(const Options& options);
  void recorded(const Recorded& frame);

  design::Machine machine_;
  plant::PlantFile plant_;
  std::vector<Recorded>* sent_ = nullptr;
  std::FILE* log_ = nullptr;
  bool log_failed_ = false;
  std::string throw_away_;  // folder of a copied store
  std::unique_ptr<plant::World> world_;
  bool elsewhere_ = false;  // every bus is a plant's in another process
  std::unique_ptr<io::Loop> loop_;
  std::vector<std::unique_ptr<BusTap>> taps_;
  std::vector<std::unique_ptr<can::Port>> ports_;
  std::unique_ptr<places::SlotStore> store_;
  std::unique_ptr<operate::Session> session_;
};

}  // namespace berth::cli
