/// The gates of the buses that are outside this process: what Berth may send there, and which other master is there.
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
  /// Told when another master shuts a bus: its name, who it is and what to do in a sentence, and all that is to be
  /// told.
  using Foreign = std::function<void(const std::string& bus, const std::string& verdict, const std::string& text)>;
  /// Told when another SDO client asks a slot: the bus, and what to tell the person.
  using Client = std::function<void(const std::string& bus, const std::string& text)>;
  /// `record` gets the frames. Both must stay.
  Guards(const design::Machine& machine, Record& record) : machine_(&machine), record_(&record) {}
  Guards(const Guards&) = delete;
  Guards& operator=(const Guards&) = delete;

  /// Puts a gate before the port of a bus. The port and its executor, one for all of them, must stay.
  can::Port& add(rt::Executor& executor, const design::Bus& bus, can::Port& port, const Options& options);
  void on_foreign(Foreign foreign) { on_foreign_ = std::move(foreign); }
  /// Told when another SDO client asks a node for the first time.
  void on_client(Client client) { on_client_ = std::move(client); }

  [[nodiscard]] bool empty() const noexcept { return gates_.empty(); }
  /// Null: the bus is simulated here.
  [[nodiscard]] live::Gate* gate(std::string_view bus) noexcept;
  /// Each has listened long enough, or cannot.
  [[nodiscard]] bool decided() const noexcept;
  /// Refused, status 1, when another master is on a bus: which one, and by which frames.
  [[nodiscard]] tl::expected<void, Failure> no_foreign_frames() const;
  /// Every bus of the machine is shut: another master is on each of them.
  [[nodiscard]] bool shut_out() const noexcept;
  /// Dry run: the first question was put, and what comes then depends on the answer.
  [[nodiscard]] bool dry_run_over() const noexcept;

 private:
  void changed(const std::string& bus, const live::Gate& gate);
  rt::Executor* executor_ = nullptr;
  const design::Machine* machine_;
  Record* record_;
  Foreign on_foreign_;
  Client on_client_;
  std::vector<std::pair<std::string, std::unique_ptr<live::Gate>>> gates_;
  rt::Time question_at_ = rt::never;  // dry run: the first frame that would have to be answered
};

}  // namespace berth::cli
