/// Before Berth takes a bus that is outside this process: is another master there? Heard first, then asked.
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
  /// The session's buses have their ports. All four must stay.
  Strangers(rt::Driver& driver, Interrupt& interrupt, tree::Session& session, Guards& guards)
      : driver_(&driver), interrupt_(&interrupt), session_(&session), guards_(&guards) {}

  /// Waits until every gate has listened long enough (nothing to wait for on simulated buses). Refused, status 1, when
  /// another master is on a bus: which one, and by which frames; and when a signal came. A port that is down is no
  /// failure here.
  [[nodiscard]] tl::expected<void, Failure> listen_first();
  /// Asks the nodes that were heard meanwhile and belong to no slot whether they are NMT masters, however quiet (1F80h
  /// bit 0, CiA 302-2), on every bus outside this process whose master Berth is to be. Refused as by `listen_first`.
  /// `first`: the machine never ran. Then all that were heard are asked, and those are kept of whose type the machine
  /// has no slot: each may be the master of a plant that runs.
  [[nodiscard]] tl::expected<void, Failure> ask(bool first);
  /// One line for each of those; empty when there is none.
  [[nodiscard]] const std::vector<std::string>& may_be_masters() const noexcept { return may_be_masters_; }

 private:
  [[nodiscard]] tl::expected<void, Failure> not_ended();
  void ask_all(const design::Bus& bus, live::Census& census, bool first);
  rt::Driver* driver_;
  Interrupt* interrupt_;
  tree::Session* session_;
  Guards* guards_;
  std::map<std::string, std::unique_ptr<live::Census>> heard_;  // by bus, while Berth listens before it takes it
  std::vector<std::string> may_be_masters_;
};

}  // namespace berth::cli
