/// A machine, the simulated world it runs on, its store and the session, put together from files.
#pragma once

#include <cstdio>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <vector>

#include "berth/design/machine.hpp"
#include "berth/io/loop.hpp"
#include "berth/live/census.hpp"
#include "berth/live/gate.hpp"
#include "berth/operate/session.hpp"
#include "berth/plant/world.hpp"
#include "interrupt.hpp"
#include "options.hpp"
#include "output.hpp"
#include "ports.hpp"

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
  /// The signals that end a command: in place before the store is opened.
  [[nodiscard]] Interrupt& interrupt() noexcept { return *interrupt_; }
  /// A bus at least is outside this process (a real port, or a `berth plant` in another process): real time only, by
  /// this loop. The world has those buses alone that are simulated here. Null: all of them are.
  [[nodiscard]] io::Loop* loop() noexcept { return loop_.get(); }
  /// The gate of a bus that is outside this process, for a user of it instead of the session; null: simulated here.
  [[nodiscard]] can::Port* outside(std::string_view bus) noexcept;
  [[nodiscard]] const live::Gate* gate(std::string_view bus) const noexcept;
  /// Keeps the frames that Berth sends from now on.
  void record_sent(std::vector<Recorded>& into) { sent_ = &into; }
  /// Waits until every gate has listened long enough (nothing to wait for on simulated buses). Refused, status 1, when
  /// another master is on a bus: which, and by which frames; and when a signal came. A port that is down is no failure
  /// here.
  [[nodiscard]] tl::expected<void, Failure> listen_first();
  /// Asks the nodes that were heard meanwhile and belong to no slot whether they are NMT masters, however quiet (1F80h
  /// bit 0, CiA 302-2), on every bus outside this process whose master Berth is to be. Refused as by `listen_first`.
  [[nodiscard]] tl::expected<void, Failure> ask_strangers();
  /// Confirmation of a person is wanted, or was given by --yes: the first start of a machine whose devices are real.
  [[nodiscard]] bool first_start();
  /// Dry run on a real port: the first question was put, and what comes then depends on the answer.
  [[nodiscard]] bool dry_run_over() const noexcept;
  /// Ends a session as the machine file, or --on-exit, wants: its NMT command goes out before this returns.
  void leave(const Options& options);
  /// Every bus's port is shut: another master is on each of them.
  [[nodiscard]] bool shut_out() const noexcept;
  /// False when a line of `--record` could not be written.
  [[nodiscard]] bool record_kept() noexcept { return !log_failed_ && (log_ == nullptr || std::fflush(log_) == 0); }

 private:
  class BusTap;
  Rig() = default;
  [[nodiscard]] tl::expected<void, Failure> read(const Options& options, const Sources& sources);
  [[nodiscard]] tl::expected<std::unique_ptr<can::Port>, Failure> open_port(const design::Bus& bus);
  [[nodiscard]] std::unique_ptr<can::Port> reopening(const design::Bus& bus, std::unique_ptr<can::Port> port);
  [[nodiscard]] tl::expected<can::Port*, Failure> attach(const design::Bus& bus, const Options& options);
  [[nodiscard]] tl::expected<void, Failure> settle_ports(const Options& options, bool simulate);
  [[nodiscard]] tl::expected<void, Failure> build_world(const Options& options);
  [[nodiscard]] tl::expected<void, Failure> open_store(const Options& options);
  [[nodiscard]] tl::expected<std::string, Failure> copied_store(const std::string& path);
  [[nodiscard]] tl::expected<void, Failure> open_session(const Options& options);
  [[nodiscard]] std::unique_ptr<can::Port> guard(const design::Bus& bus, can::Port& port, const Options& options);
  void gate_changed(const std::string& bus, const live::Gate& gate);
  [[nodiscard]] tl::expected<void, Failure> no_foreign_frames() const;
  [[nodiscard]] tl::expected<void, Failure> not_ended();
  [[nodiscard]] std::string quiet_masters(const design::Bus& bus, live::Census& census);
  void recorded(const Recorded& frame);

  design::Machine machine_;
  plant::PlantFile plant_;
  std::vector<Recorded>* sent_ = nullptr;
  std::FILE* log_ = nullptr;
  bool log_failed_ = false;
  std::string throw_away_;  // folder of a copied store
  std::optional<Interrupt> interrupt_;
  std::unique_ptr<plant::World> world_;
  bool outside_ = false;  // a bus is outside this process
  std::unique_ptr<io::Loop> loop_;
  std::vector<std::unique_ptr<BusTap>> taps_;
  std::vector<std::unique_ptr<can::Port>> raw_;  // real ports; their gates are among `ports_`
  std::vector<std::unique_ptr<can::Port>> ports_;
  std::vector<std::pair<std::string, live::Gate*>> gates_;
  std::vector<PortLock> locks_;
  rt::Time question_at_ = rt::never;  // dry run: the first frame that a device would have to answer
  std::unique_ptr<places::SlotStore> store_;
  std::unique_ptr<operate::Session> session_;
  std::map<std::string, std::unique_ptr<live::Census>> heard_;  // by bus, while Berth listens before it takes it
};

}  // namespace berth::cli
