/// Looks for another master before Berth takes a bus outside this process: first it listens, then it asks.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "berth/live/census.hpp"
#include "berth/rt/driver.hpp"
#include "berth/tree/session.hpp"
#include "guards.hpp"
#include "interrupt.hpp"

namespace berth::cli {

class Strangers {
 public:
  /// The session's buses have their ports. All four must outlive it.
  Strangers(rt::Driver& driver, Interrupt& interrupt, tree::Session& session, Guards& guards)
      : driver_(&driver), interrupt_(&interrupt), session_(&session), guards_(&guards) {}

  /// Waits until every gate has listened long enough (not on simulated buses). Refused, status 1, when another master
  /// is on a bus (the failure names it and its frames), or when a signal came. A port that is down is no failure here.
  [[nodiscard]] tl::expected<void, Failure> listen_first();
  /// Asks the heard nodes that belong to no slot whether they are NMT masters, however quiet (1F80h bit 0, CiA 302-2),
  /// on every bus outside this process whose master Berth is to be. Refused as in `listen_first`. `first`: the machine
  /// never ran; then it asks all heard nodes, and keeps those for whose type the machine has no slot: each may be the
  /// master of a running plant.
  [[nodiscard]] tl::expected<void, Failure> ask(bool first);
  /// One line for each kept node; empty if there is none.
  [[nodiscard]] const std::vector<std::string>& may_be_masters() const noexcept { return may_be_masters_; }

 private:
  [[nodiscard]] tl::expected<void, Failure> not_ended();
  void ask_all(const design::Bus& bus, live::Census& census, bool first);
  rt::Driver* driver_;
  Interrupt* interrupt_;
  tree::Session* session_;
  Guards* guards_;
  std::map<std::string, std::unique_ptr<live::Census>> heard_;  // by bus, until Berth takes it
  std::vector<std::string> may_be_masters_;
};

}  // namespace berth::cli
