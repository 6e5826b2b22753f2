/// Before Berth takes a bus that is outside this process: is another master there? Heard first, then asked.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <tl/expected.hpp>

#include "berth/live/census.hpp"
#include "berth/operate/session.hpp"
#include "berth/rt/driver.hpp"
#include "guards.hpp"

namespace berth::cli {

class Strangers {
 public:
  /// The session's buses have their ports. All three must stay.
  Strangers(rt::Driver& driver, operate::Session& session, Guards& guards)
      : driver_(&driver), session_(&session), guards_(&guards) {}

  /// Waits until every gate has listened long enough (nothing to wait for on simulated buses). Refused, status 1, when
  /// another master is on a bus: which one, and by which frames. A port that is down is no failure here.
  [[nodiscard]] tl::expected<void, Failure> listen_first();
  /// Asks the nodes that were heard meanwhile and belong to no slot whether they are NMT masters, however quiet (1F80h
  /// bit 0, CiA 302-2), on every bus outside this process whose master Berth is to be. Refused as by `listen_first`.
  [[nodiscard]] tl::expected<void, Failure> ask();

 private:
  [[nodiscard]] std::string quiet_masters(const design::Bus& bus, live::Census& census);
  rt::Driver* driver_;
  operate::Session* session_;
  Guards* guards_;
  std::map<std::string, std::unique_ptr<live::Census>> heard_;  // by bus, while Berth listens before it takes it
};

}  // namespace berth::cli
