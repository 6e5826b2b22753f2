/// The parts of a search of a bus: the discovery methods that `discovery =` selects, the options that suit the bus, and
/// what is known of its devices.
#pragma once

#include <memory>
#include <string>

#include "berth/discovery/auto.hpp"
#include "berth/operate/lending.hpp"

namespace berth::operate {

class SearchMethods {
 public:
  SearchMethods(BusServices& services, SlotTable& slots, const Agenda& agenda, const FoundDevices& found,
                Lending& lending);

  /// All that RAND does not find, with `also_configured` also devices with a node-ID.
  [[nodiscard]] discovery::Auto& rest(bool also_configured);
  /// By `discovery =`. Null: there is no such method; this is reported.
  [[nodiscard]] discovery::Discovery* chosen();
  [[nodiscard]] rt::Task<Result<discovery::Report>> ask_rand_planner(discovery::Observer* observer);
  /// `observer`: may be null.
  [[nodiscard]] rt::Task<Result<discovery::Report>> ask_rand_as_published(nodeid::DiscoveryObserver* observer);

  /// From the slots, and from what was found so far.
  [[nodiscard]] discovery::Known known_devices() const;
  [[nodiscard]] discovery::Options options(discovery::Observer* observer) const;
  [[nodiscard]] nodeid::DiscoveryOptions rand_options() const;

 private:
  [[nodiscard]] rt::Duration longest_frame() const;
  [[nodiscard]] rt::Duration rand_window() const;

  BusServices& s_;
  SlotTable& slots_;
  const Agenda& agenda_;
  const FoundDevices& found_;
  Lending& lending_;
  std::unique_ptr<discovery::Discovery> rand_planner_;
  std::unique_ptr<discovery::Auto> rest_;
  std::unique_ptr<discovery::Discovery> chosen_;
  std::string chosen_name_;
};

}  // namespace berth::operate
