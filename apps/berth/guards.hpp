/// The gates of the buses outside this process. A gate decides what Berth may send there, and reports another master.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <utility>
#include <vector>

#include "berth/design/machine.hpp"
#include "berth/live/gate.hpp"
#include "options.hpp"
#include "output.hpp"
#include "record.hpp"

namespace berth::cli {

class Guards {
 public:
  /// Called when another master shuts a bus: the bus's name; in one sentence who it is and what to do; and the full
  /// text.
  using Foreign = std::function<void(const std::string& bus, const std::string& verdict, const std::string& text)>;
  /// Called when another SDO client asks a slot: the bus, and the message for the user.
  using Client = std::function<void(const std::string& bus, const std::string& text)>;
  /// `record` gets the frames. Both must outlive it.
  Guards(const design::Machine& machine, Record& record) : machine_(&machine), record_(&record) {}
  Guards(const Guards&) = delete;
  Guards& operator=(const Guards&) = delete;

  /// Puts a gate before the port of a bus. The port must outlive it, and so must the executor, one for all ports.
  can::Port& add(rt::Executor& executor, const design::Bus& bus, can::Port& port, const Options& options);
  void on_foreign(Foreign foreign) { on_foreign_ = std::move(foreign); }
  /// Called when another SDO client asks a node for the first time.
  void on_client(Client client) { on_client_ = std::move(client); }

  [[nodiscard]] bool empty() const noexcept { return gates_.empty(); }
  /// Null: the bus is simulated here.
  [[nodiscard]] live::Gate* gate(std::string_view bus) noexcept;
  /// Each gate has listened long enough, or cannot listen.
  [[nodiscard]] bool decided() const noexcept;
  /// Refused, status 1, when another master is on a bus; the failure names it and its frames.
  [[nodiscard]] tl::expected<void, Failure> no_foreign_frames() const;
  /// Another master has shut every bus of the machine.
  [[nodiscard]] bool shut_out() const noexcept;
  /// Dry run: the first request was sent, and what follows depends on its answer.
  [[nodiscard]] bool dry_run_over() const noexcept;

 private:
  void changed(const std::string& bus, const live::Gate& gate);
  rt::Executor* executor_ = nullptr;
  const design::Machine* machine_;
  Record* record_;
  Foreign on_foreign_;
  Client on_client_;
  std::vector<std::pair<std::string, std::unique_ptr<live::Gate>>> gates_;
  rt::Time question_at_ = rt::never;  // dry run: time of the first frame that needs an answer
};

}  // namespace berth::cli
