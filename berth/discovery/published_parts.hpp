/// Shared by the methods RAND, AND and Fastscan: converts their masters' reports.
#pragma once

#include "berth/discovery/discovery.hpp"
#include "berth/nodeid/rand_master.hpp"

namespace berth::discovery {

/// The ends of RAND's and AND's masters as the end of a report.
[[nodiscard]] Report::End end_of(nodeid::DiscoveryReport::End end) noexcept;

/// A master's report without its devices. AND's, Fastscan's and the walk's reports use the same names.
template <class Done>
[[nodiscard]] Report numbers_of(const Done& done, Report::End end, unsigned restarts) {
  Report report;
  report.end = end;
  report.requests = done.requests;
  report.restarts = restarts;
  report.began = done.began;
  report.known = done.known;
  report.ended = done.ended;
  return report;
}

/// A device whose method gives its address but not its node-ID.
[[nodiscard]] constexpr Found found_by(Method by, const LssAddress& address, rt::Time at,
                                       bool possible_clone) noexcept {
  Found found;
  found.address = address;
  found.at = at;
  found.possible_clone = possible_clone;
  found.by = by;
  return found;
}

/// Makes devices that sit in their slots not answer RAND (S1.31 step 3).
[[nodiscard]] rt::Task<Result<void>> tell_who_is_known(nodeid::RandMaster& rand, const Known& known,
                                                       const Options& options);
/// For RAND as published.
[[nodiscard]] nodeid::DiscoveryOptions rand_options(const Options& options);

}  // namespace berth::discovery
